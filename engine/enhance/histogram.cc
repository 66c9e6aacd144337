// Enhancers by histogram, from OpenCV.
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "engine/enhance/enhance.h"

namespace litags {
namespace {

// Runs `change` on one channel of `picture`, in place.
template <class Change>
void OnChannel(cv::Mat& picture, int channel, Change change) {
  cv::Mat plane;
  cv::extractChannel(picture, plane, channel);
  change(plane);
  cv::insertChannel(plane, picture, channel);
}

cv::Mat Wrap(ImageU8& image) {
  return cv::Mat(image.height, image.width, CV_8UC3, image.data.data());
}

// OpenCV makes its tables for Lab at the first conversion, twice if two threads come first.
void MakeLabTables() {
  static const bool made = [] {
    cv::Mat pixel(1, 1, CV_8UC3, cv::Scalar::all(0));
    cv::cvtColor(pixel, pixel, cv::COLOR_RGB2Lab);
    cv::cvtColor(pixel, pixel, cv::COLOR_Lab2RGB);
    return true;
  }();
  (void)made;
}

}  // namespace

ImageU8 EnhanceHistogram(const ImageU8& photo) {
  ImageU8 out = photo;
  cv::Mat view = Wrap(out);
  for (int c = 0; c < 3; ++c) {
    OnChannel(view, c, [](cv::Mat& plane) { cv::equalizeHist(plane, plane); });
  }
  return out;
}

ImageU8 EnhanceClahe(const ImageU8& photo) {
  MakeLabTables();
  ImageU8 out = photo;
  cv::Mat view = Wrap(out), lab;
  cv::cvtColor(view, lab, cv::COLOR_RGB2Lab);
  OnChannel(lab, 0,
            [](cv::Mat& plane) { cv::createCLAHE(4.0, cv::Size(8, 8))->apply(plane, plane); });
  cv::cvtColor(lab, view, cv::COLOR_Lab2RGB);
  return out;
}

}  // namespace litags
