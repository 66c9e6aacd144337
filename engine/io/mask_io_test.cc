#include "engine/io/mask_io.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/mask.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

constexpr int kWidth = 12, kHeight = 8;

// Masks the left half.
PlaneU8 RightHalf() {
  PlaneU8 mask(kWidth, kHeight);
  for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = i % kWidth < 6 ? 0 : kCounts;
  return mask;
}

void Write(const std::string& path, const std::string& bytes) {
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
}

class MaskIo : public ::testing::Test {
 protected:
  MaskIo() {
    ImageU8 photo(kWidth, kHeight);
    std::fill(photo.data.begin(), photo.data.end(), uint8_t{80});
    for (int y = 0; y < kHeight; ++y) photo.pixel(1, y)[0] = 250;  // under the mask
    EXPECT_TRUE(WritePng(photo_, photo).ok());
  }

  std::string ReasonOfMask(const std::string& bytes) {
    Write(mask_, bytes);
    return Reason(ReadMaskedPhoto(photo_, "images[p.png]", mask_).status());
  }

  TempDir dir_;
  std::string photo_ = dir_ / "p.png", mask_ = dir_ / "m.png";
};

TEST_F(MaskIo, APhotoComesWithItsMaskAndWithoutWhatWasUnderIt) {
  Write(mask_, EncodeMask(RightHalf()).value());
  const auto photo = ReadMaskedPhoto(photo_, "images[p.png]", mask_);
  ASSERT_TRUE(photo.ok()) << photo.status();
  EXPECT_EQ(photo->mask.data, RightHalf().data);
  for (const uint8_t code : PhotoToU8(photo->photo).data) ASSERT_EQ(code, 80);
  const auto plain = ReadMaskedPhoto(photo_, "images[p.png]", "");
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_TRUE(plain->mask.empty());
  EXPECT_EQ(PhotoToU8(plain->photo).pixel(1, 0)[0], 250);
}

TEST_F(MaskIo, AnyChannelThatIsNotZeroCounts) {
  ImageU8 colors(3, 1);
  colors.pixel(0, 0)[2] = 1;
  colors.pixel(2, 0)[0] = 128;
  const auto mask = DecodeMask(EncodePng(colors).value(), "masks[m.png]");
  ASSERT_TRUE(mask.ok()) << mask.status();
  EXPECT_EQ(mask->data, (std::vector<uint8_t>{kCounts, 0, kCounts}));
}

// As cut-outs are, whose alpha channel is the mask.
TEST_F(MaskIo, AlphaDoesNotCountAndIsRefusedWhereColourMasksNothing) {
  const auto png = [](uint8_t color, uint8_t alpha) {
    const uint8_t codes[2][4] = {{200, 200, 200, 255}, {color, color, color, alpha}};
    return EncodePngCodes(codes[0], 2, 1, 4).value();
  };
  const auto mask = DecodeMask(png(0, 0), "masks[m.png]");
  ASSERT_TRUE(mask.ok()) << mask.status();
  EXPECT_EQ(mask->data, (std::vector<uint8_t>{kCounts, 0}));
  EXPECT_TRUE(DecodeMask(png(9, 255), "masks[m.png]").ok());
  EXPECT_EQ(Reason(DecodeMask(png(9, 0), "masks[m.png]").status()), "MASK_FORMAT");
}

// As programs of segmentation write them: 1 is the smallest code, which a profile makes black.
TEST_F(MaskIo, OneOfAMaskOfZeroesAndOnesCountsUnderAnyProfile) {
  constexpr size_t kHeaderEnd = 8 + 25;                         // magic and IHDR
  constexpr char kGamma[] = "\0\0\0\4gAMA\0\0\x94p\xCE\x0D^o";  // 0.38
  PlaneU8 ones = RightHalf();
  for (uint8_t& code : ones.data) code = code != 0 ? 1 : 0;
  const std::string plain = EncodeMask(ones).value();
  std::string gamma = plain;
  gamma.insert(kHeaderEnd, kGamma, sizeof(kGamma) - 1);
  ASSERT_EQ(DecodeImage(gamma, "f")->data[3 * kWidth - 1], 0);
  for (const std::string& bytes : {plain, gamma}) {
    const auto mask = DecodeMask(bytes, "masks[m.png]");
    ASSERT_TRUE(mask.ok()) << mask.status();
    EXPECT_EQ(mask->data, RightHalf().data);
  }
}

TEST_F(MaskIo, MasksOfOneBitAreRead) {
  PlaneU8 mask = RightHalf();
  const cv::Mat gray(kHeight, kWidth, CV_8U, mask.data.data());
  std::vector<uint8_t> png;
  ASSERT_TRUE(cv::imencode(".png", gray, png, {cv::IMWRITE_PNG_BILEVEL, 1}));
  const std::string bytes(png.begin(), png.end());
  ASSERT_EQ(ReadImageInfo(bytes, "f")->bit_depth, 1);
  EXPECT_EQ(DecodeMask(bytes, "masks[m.png]")->data, RightHalf().data);
}

TEST_F(MaskIo, WrongSizesFormatsAndBlackMasksAreRefusedByName) {
  PlaneU8 small(kWidth, kHeight - 1);
  std::fill(small.data.begin(), small.data.end(), kCounts);
  EXPECT_EQ(ReasonOfMask(EncodeMask(small).value()), "MASK_SIZE");
  const auto status = ReadMaskedPhoto(photo_, "images[p.png]", mask_).status();
  EXPECT_EQ(status.message(),
            "masks[m.png]: the mask is 12x7 px, its photo upright 12x8; make masks of the photo's "
            "size");
  EXPECT_EQ(ReasonOfMask(EncodeMask(PlaneU8(kWidth, kHeight)).value()), "MASK_BLACK");
  EXPECT_EQ(ReasonOfMask(EncodePng16(Planes(1, kHeight, kWidth)).value()), "MASK_FORMAT");
  EXPECT_EQ(ReasonOfMask(EncodeJpeg(ImageU8(kWidth, kHeight)).value()), "MASK_FORMAT");
  EXPECT_EQ(ReasonOfMask("P5 no picture"), "IMAGE_NOT_RECOGNIZED");
  std::string cut = EncodeMask(RightHalf()).value();
  cut.resize(cut.size() - 20);
  EXPECT_EQ(ReasonOfMask(cut), "IMAGE_TRUNCATED");
}

TEST_F(MaskIo, ALargeMaskIsRefusedByItsHeader) {
  std::string bytes = EncodeMask(RightHalf()).value();
  bytes[18] = bytes[22] = 0x7f;  // width and height in the PNG's header: 2^15 - 256 or so
  EXPECT_EQ(Reason(DecodeMask(bytes, "masks[m.png]").status()), "IMAGE_TOO_LARGE");
}

TEST_F(MaskIo, AFolderOfMasksIsMatchedWithPhotos) {
  const std::string folder = dir_ / "masks";
  EXPECT_EQ(Reason(FindMasks(folder, {"p.png"}).status()), "NO_SUCH_FOLDER");
  std::filesystem::create_directory(folder);
  Write(folder + "/readme.txt", "x");
  EXPECT_EQ(Reason(FindMasks(folder, {"p.png"}).status()), "NO_MASKS");
  Write(folder + "/p.png.png", "x");
  Write(folder + "/.hidden.png", "x");
  const auto masks = FindMasks(folder, {"o.png", "p.png"});
  ASSERT_TRUE(masks.ok()) << masks.status();
  EXPECT_EQ(*masks, (MaskPaths{{"p.png", folder + "/p.png.png"}}));
  Write(folder + "/q.png", "x");
  EXPECT_EQ(Reason(FindMasks(folder, {"o.png", "p.png"}).status()), "MASK_WITHOUT_PHOTO");
}

TEST_F(MaskIo, AShrunkPixelCountsIfAllOfItsSourcesDo) {
  PlaneU8 mask(8, 4);
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  mask.data[9] = 0;  // (1, 1)
  const PlaneU8 half =
      ChangeMask(mask, [](const ImageU8& image) { return ResizeArea(image, 4, 2); });
  EXPECT_EQ(half.data, (std::vector<uint8_t>{0, 255, 255, 255, 255, 255, 255, 255}));
}

}  // namespace
}  // namespace litags
