// Files that are named wrongly, and files that ask for more memory than a photo may.
#include <zlib.h>

#include <fstream>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/heif_codecs.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/io/testing_photos.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using testing::HasSubstr;

// Bits, most significant first.
class BitWriter {
 public:
  void Bits(uint64_t value, int n) {
    for (int i = n - 1; i >= 0; --i) Bit(value >> i & 1);
  }
  // ue(v), Exp-Golomb.
  void Number(uint64_t value) {
    int n = 0;
    while ((value + 1) >> (n + 1) != 0) ++n;
    Bits(0, n);
    Bits(value + 1, n + 1);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void Bit(bool bit) {
    if (used_ % 8 == 0) bytes_ += '\0';
    if (bit) bytes_.back() = static_cast<char>(bytes_.back() | 0x80 >> used_ % 8);
    ++used_;
  }
  std::string bytes_;
  int used_ = 0;
};

// The beginning of an HEVC stream's sequence parameters.
std::string HevcSequence(uint32_t width, uint32_t height, int layers = 1, int chroma = 1) {
  BitWriter bits;
  bits.Bits(0x4201, 16);
  bits.Bits(0, 4);
  bits.Bits(layers - 1, 3);
  bits.Bits(1, 1);
  for (int i = 0; i < 12; ++i) bits.Bits(0xA5, 8);  // profile and level
  for (int i = 0; i + 1 < layers; ++i) bits.Bits(3, 2);
  if (layers > 1) bits.Bits(0, 2 * (9 - layers));
  for (int i = 0; i + 1 < layers; ++i) {
    for (int k = 0; k < 12; ++k) bits.Bits(0x5A, 8);
  }
  bits.Number(0);
  bits.Number(chroma);
  if (chroma == 3) bits.Bits(0, 1);
  bits.Number(width);
  bits.Number(height);
  bits.Bits(0x80, 8);
  return bits.bytes();
}

// With each occurrence of a box's number at `offset` behind its name replaced.
std::string WithBoxNumber(std::string file, const std::string& box, size_t offset,
                          const std::string& number) {
  for (size_t at = file.find(box); at != std::string::npos; at = file.find(box, at + 1)) {
    file.replace(at + offset, number.size(), number);
  }
  return file;
}

TEST(Content, DecidesWhateverTheNameIs) {
  const TempDir dir;
  for (const TestFormat& format : TestFormats()) {
    for (const char* name : {"a.jpg", "b.heic", "c.dng"}) {
      const std::string path = dir / name;
      std::ofstream(path, std::ios::binary) << format.encode(Ramp(), {});
      const auto info = ReadImageSize(path, name);
      ASSERT_TRUE(info.ok()) << format.name << info.status();
      EXPECT_EQ(info->format, format.format) << format.name << name;
    }
  }
}

TEST(Content, ThatIsNoPhotoIsToldByTheNameAndAllFormats) {
  for (const std::string_view ending : PhotoEndings()) {
    const std::string field = "images[a" + std::string(ending) + "]";
    EXPECT_EQ(Reason(DecodePhoto("", field).status()), "IMAGE_EMPTY");
    for (const char* bytes : {"<!DOCTYPE html>", "a", "%PDF-1.5"}) {
      const absl::Status status = DecodePhoto(bytes, field).status();
      EXPECT_EQ(Reason(status), "IMAGE_NOT_RECOGNIZED");
      EXPECT_THAT(std::string(status.message()), testing::StartsWith(field));
      EXPECT_THAT(std::string(status.message()),
                  HasSubstr("(JPEG, PNG, cameras' RAW, TIFF, WebP, HEIC, AVIF, JPEG XL)"));
    }
  }
}

TEST(Content, OfAFolderWithoutPhotosIsToldWithAllEndings) {
  const TempDir dir;
  const absl::Status status = ListPhotos(dir.path(), "images").status();
  EXPECT_THAT(std::string(status.message()), HasSubstr(".jpg .jpeg .jpe .jfif .png .tif"));
  EXPECT_THAT(std::string(status.message()), HasSubstr(".srw)"));
}

TEST(Bomb, HeifIsRefusedByTheSizeThatItStates) {
  for (const bool av1 : {false, true}) {
    const std::string file = EncodeTestHeif(Ramp(), av1, 8);
    for (const uint32_t side : {20'000u, 40'000u, 0x7FFFFFFFu, 0xFFFFFFFFu}) {
      const std::string bomb = WithBoxNumber(file, "ispe", 8, Big32(side) + Big32(side));
      const absl::Status status = ReadImageInfo(bomb, "f").status();
      EXPECT_EQ(Reason(status), "IMAGE_TOO_LARGE") << side << status;
    }
  }
}

TEST(Bomb, HeifStreamsStateTheirSize) {
  for (const int layers : {1, 2, 7}) {
    for (const int chroma : {0, 1, 3}) {
      const CodedSize size = HevcSizeOf(HevcSequence(4032, 3024, layers, chroma));
      EXPECT_EQ(size.width, 4032u) << layers << chroma;
      EXPECT_EQ(size.height, 3024u) << layers << chroma;
    }
  }
  // As an encoder writes it, with the bytes that keep start codes out.
  const std::string file = EncodeTestHeif(Ramp(3, 200, 120), false, 8);
  const size_t at = file.find("\x42\x01\x01");
  ASSERT_NE(at, std::string::npos);
  const CodedSize size = HevcSizeOf(file.substr(at, 100));
  EXPECT_EQ(size.width, 200u);
  EXPECT_EQ(size.height, 120u);
}

TEST(Bomb, HeifStreamsThatHoldMoreThanIsTakenAreRefusedBeforeTheyAreDecoded) {
  const auto push = [](const std::string& nal) {
    void* decoder = nullptr;
    kHevcCodec.new_decoder(&decoder);
    const std::string data = Big32(static_cast<uint32_t>(nal.size())) + nal;
    const heif_error error = kHevcCodec.push_data(decoder, data.data(), data.size());
    kHevcCodec.free_decoder(decoder);
    return error.subcode;
  };
  EXPECT_EQ(push(HevcSequence(8192, 8192)), heif_suberror_Unspecified);
  for (const auto& [width, height] :
       {std::pair{8400u, 8192u}, {70'000u, 16u}, {70'000u, 70'000u}, {0xFFFFFFFEu, 2u}}) {
    EXPECT_EQ(push(HevcSequence(width, height)), heif_suberror_Security_limit_exceeded)
        << width << " x " << height;
  }
  EXPECT_EQ(push(std::string("\x42\x01", 2) + std::string(600, '\0')),
            heif_suberror_Security_limit_exceeded)
      << "an endless number";
}

TEST(Bomb, HeifWhoseStreamHoldsAnotherPictureIsRefused) {
  // The file's own size stays, the stream is that of a larger picture.
  const std::string file = EncodeTestHeif(Ramp(3, 200, 120), false, 8);
  const std::string lie = WithBoxNumber(file, "ispe", 8, Big32(40) + Big32(24));
  ASSERT_TRUE(ReadImageInfo(lie, "f").ok());
  EXPECT_EQ(Reason(DecodePhoto(lie, "f").status()), "IMAGE_CORRUPT");
}

TEST(HeifCodecs, SamplesOfMoreBitsThanStatedAreWhite) {
  const uint16_t beyond = 1 << 10;
  CodedPicture picture;
  picture.width = picture.height = 1;
  picture.bits = 10;
  picture.chroma = heif_chroma_444;
  picture.planes.fill(reinterpret_cast<const uint8_t*>(&beyond));
  picture.strides.fill(sizeof(beyond));
  heif_image* image = nullptr;
  ASSERT_EQ(CopyPicture(picture, &image).code, heif_error_Ok);
  CodedRows rows;
  ASSERT_TRUE(rows.Open(image, 1, 1));
  float luma = 0, cb = 0, cr = 0;
  rows.Row(0, &luma, &cb, &cr);
  EXPECT_NEAR(luma, 1024, 0.1);
  EXPECT_NEAR(cr, 1024, 0.1);
  heif_image_release(image);
}

TEST(Bomb, JxlIsRefusedByTheSizeThatItStates) {
  // 200,000 px a side; the first bits are the lowest of a byte: not small; of 18 bits; the size
  // less one; square; defaults.
  const uint64_t bits = 0 | 2 << 1 | uint64_t{199'999} << 3 | uint64_t{1} << 21 | uint64_t{1} << 24;
  std::string bomb = "\xFF\x0A";
  for (int i = 0; i < 8; ++i) bomb += static_cast<char>(bits >> 8 * i);
  EXPECT_EQ(Reason(ReadImageInfo(bomb + std::string(200, '\0'), "f").status()), "IMAGE_TOO_LARGE");
}

TEST(Bomb, JxlMayHaveFewChannelsBesideItsColours) {
  EXPECT_TRUE(DecodePhoto(EncodeTestJxl(Ramp(), 8, {}, 4), "f").ok());
  EXPECT_EQ(Reason(DecodePhoto(EncodeTestJxl(Ramp(), 8, {}, 5), "f").status()),
            "IMAGE_UNSUPPORTED");
  const absl::Status status = DecodePhoto(EncodeTestJxl(Ramp(), 8, {}, 200), "f").status();
  EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("200 channels"));
}

TEST(Bomb, TiffMayHaveEightChannelsInAll) {
  EXPECT_TRUE(DecodePhoto(EncodeTestTiff(Ramp(), {.extra = 5}), "f").ok());
  const absl::Status status = DecodePhoto(EncodeTestTiff(Ramp(), {.extra = 6}), "f").status();
  EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("9 samples a pixel"));
}

TEST(Bomb, WebpIsRefusedByTheSizeThatItStates) {
  const std::string file = EncodeTestWebp(TestImage(16, 8), {.exif = ExifBlock(1, true)});
  std::string bomb = file;
  bomb.replace(24, 6, "\xFE\x3F\0\xFE\x3F\0", 6);  // 16,383 px a side, as large as WebP can be
  // Its picture is of another size, which may be seen first.
  EXPECT_THAT(Reason(ReadImageInfo(bomb, "f").status()),
              testing::AnyOf("IMAGE_TOO_LARGE", "IMAGE_CORRUPT"));
}

TEST(Bomb, RawIsRefusedByTheSizeThatItStates) {
  SensorFrame frame = FlatFrame({1000, 2000, 500});
  frame.width = 60'000;
  frame.height = 50'000;  // the numbers are far fewer
  EXPECT_THAT(Reason(DecodePhoto(EncodeDng(frame), "f").status()),
              testing::AnyOf("IMAGE_TOO_LARGE", "IMAGE_TRUNCATED"));
}

TEST(Bomb, ABoxWithoutASizeIsNotReadForEver) {
  const std::string cr3 =
      Big32(28) + "ftypcrx " + std::string(16, '\0') + Big32(1) + "free" + std::string(40, '\0');
  EXPECT_EQ(Reason(DecodePhoto(cr3, "f").status()), "IMAGE_TRUNCATED");
  EXPECT_EQ(Reason(ReadImageInfo(cr3, "f").status()), "IMAGE_TRUNCATED");
}

TEST(Bomb, ProfilesThatInflateToMuchArePassedOver) {
  const std::string png = EncodePng(TestImage(16, 8)).value();
  const std::string zeros(64 << 20, '\0');
  std::string deflated(compressBound(zeros.size()), '\0');
  uLongf size = deflated.size();
  compress(reinterpret_cast<Bytef*>(deflated.data()), &size,
           reinterpret_cast<const Bytef*>(zeros.data()), zeros.size());
  const std::string chunk = std::string("iCCPx\0\0", 7) + deflated.substr(0, size);
  const auto crc = static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(chunk.data()), static_cast<uInt>(chunk.size())));
  constexpr size_t kHeader = 33;  // signature and IHDR
  const std::string bomb = png.substr(0, kHeader) + Big32(uint32_t(chunk.size() - 4)) + chunk +
                           Big32(crc) + png.substr(kHeader);
  const auto photo = DecodePhoto(bomb, "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  EXPECT_EQ(photo->data, DecodePhoto(png, "f")->data);
}

}  // namespace
}  // namespace litags
