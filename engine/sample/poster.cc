#include "engine/sample/poster.h"

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "engine/core/rng.h"

namespace litags::sample {
namespace {

// RGB, as our images are; OpenCV's drawing does not care about the order.
cv::Scalar Color(uint32_t rgb) {
  return cv::Scalar((rgb >> 16) & 255, (rgb >> 8) & 255, rgb & 255);
}

// The image's own bytes as an OpenCV matrix.
cv::Mat Canvas(ImageU8& image) {
  return cv::Mat(image.height, image.width, CV_8UC3, image.data.data());
}

void Fade(cv::Mat& canvas, uint32_t top, uint32_t bottom) {
  for (int y = 0; y < canvas.rows; ++y) {
    const double t = static_cast<double>(y) / canvas.rows;
    canvas.row(y).setTo(Color(top) * (1 - t) + Color(bottom) * t);
  }
}

void Write(cv::Mat& canvas, const std::string& text, int x, int y, double size, uint32_t color,
           int thickness) {
  cv::putText(canvas, text, {x, y}, cv::FONT_HERSHEY_DUPLEX, size, Color(color), thickness,
              cv::LINE_AA);
}

void Disc(cv::Mat& canvas, int x, int y, int radius, uint32_t color) {
  cv::circle(canvas, {x, y}, radius, Color(color), cv::FILLED, cv::LINE_AA);
}

// A ridge of hills: a filled polygon under a broken line.
void Hills(cv::Mat& canvas, int base, int height, uint32_t color, uint64_t stream) {
  const CounterRng rng(7, stream);
  std::vector<cv::Point> line = {{0, canvas.rows}};
  for (int i = 0; i <= 12; ++i) {
    line.emplace_back(i * canvas.cols / 12, base - static_cast<int>(height * rng.Uniform(i)));
  }
  line.emplace_back(canvas.cols, canvas.rows);
  cv::fillPoly(canvas, line, Color(color), cv::LINE_AA);
}

}  // namespace

ImageU8 DrawPoster() {
  ImageU8 image(420, 600);
  cv::Mat canvas = Canvas(image);
  Fade(canvas, 0x14213D, 0xFCA311);
  const CounterRng rng(3, 0);
  for (int i = 0; i < 90; ++i) {
    Disc(canvas, static_cast<int>(rng.Below(3 * i, 420)),
         static_cast<int>(rng.Below(3 * i + 1, 280)), 1 + static_cast<int>(rng.Below(3 * i + 2, 3)),
         0xF1E9D2);
  }
  Disc(canvas, 210, 330, 118, 0xFFE8A3);
  Disc(canvas, 210, 330, 92, 0xFFD166);
  Hills(canvas, 440, 70, 0x7B2D26, 1);
  Hills(canvas, 500, 60, 0x2B2D42, 2);
  Write(canvas, "NIGHT", 62, 118, 3.0, 0xF8F4E3, 7);
  Write(canvas, "& DAY", 70, 560, 2.8, 0xFFD166, 7);
  Write(canvas, "pictures in bad light", 72, 160, 0.8, 0xF8F4E3, 1);
  Write(canvas, "open late / free entry", 60, 590, 0.8, 0xF8F4E3, 1);
  cv::rectangle(canvas, {8, 8}, {411, 591}, Color(0xF8F4E3), 3);
  return image;
}

ImageU8 DrawPainting() {
  ImageU8 image(640, 400);
  cv::Mat canvas = Canvas(image);
  Fade(canvas, 0x2E5E8C, 0xF4B393);
  Disc(canvas, 455, 165, 46, 0xFFF1C1);
  Hills(canvas, 250, 110, 0x6D597A, 3);
  Hills(canvas, 300, 80, 0x355070, 4);
  Hills(canvas, 350, 60, 0x2A4D3E, 5);
  const CounterRng rng(5, 0);
  for (int i = 0; i < 260; ++i) {  // meadow flowers
    const uint32_t petals[] = {0xE56B6F, 0xEAAC8B, 0xF7EDE2, 0xF6BD60, 0x84A59D};
    Disc(canvas, static_cast<int>(rng.Below(4 * i, 640)),
         330 + static_cast<int>(rng.Below(4 * i + 1, 70)),
         2 + static_cast<int>(rng.Below(4 * i + 2, 4)), petals[rng.Below(4 * i + 3, 5)]);
  }
  return image;
}

ImageU8 DrawColorChart() {
  ImageU8 image(480, 400);
  cv::Mat canvas = Canvas(image);
  canvas.setTo(Color(0x1C1C1C));
  constexpr std::array<uint32_t, 24> kPatches = {
      0x7A5240, 0xC99580, 0x5C7CA0, 0x58703F, 0x8682B4, 0x5FC2AE, 0xE08030, 0x4658AA,
      0xC8535F, 0x5A3B6C, 0xA2C23C, 0xE6A52B, 0x2B3A98, 0x40974A, 0xB52F38, 0xEBCB1B,
      0xC0559B, 0x0B8AA9, 0xF4F4F2, 0xC9C9C9, 0xA1A1A1, 0x797979, 0x535353, 0x2F2F2F};
  for (int i = 0; i < 24; ++i) {
    const cv::Rect patch(12 + 77 * (i % 6), 12 + 77 * (i / 6), 68, 68);
    cv::rectangle(canvas, patch, Color(kPatches[i]), cv::FILLED);
  }
  for (int x = 0; x < 24; ++x) {
    for (int y = 0; y < 3; ++y) {
      const cv::Rect square(x * 20, 332 + y * 20, 20, 20);
      cv::rectangle(canvas, square, Color((x + y) % 2 ? 0xF0F0F0 : 0x181818), cv::FILLED);
    }
  }
  return image;
}

}  // namespace litags::sample
