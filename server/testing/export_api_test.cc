// ModelService over the fake engine, whose files say what was asked for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <limits>

#include "absl/strings/str_cat.h"
#include "engine/pipeline/scene.h"
#include "server/testing/api_fixture.h"

namespace litags {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class ExportApi : public ApiTest {
 protected:
  void SetUp() override { job_ = FinishedJob(); }

  std::string job_;
};

TEST_F(ExportApi, ExportSendsTheAnnouncedBytesAndLeavesNoFile) {
  const struct {
    v1::ModelFormat format;
    double light;
    std::string kind;
  } cases[] = {{v1::MODEL_FORMAT_PLY, 0, "light 0\n"},
               {v1::MODEL_FORMAT_UNSPECIFIED, -0.5, "light -0.5\n"},
               {v1::MODEL_FORMAT_PLY, 4, "light 4\n"},
               {v1::MODEL_FORMAT_PLY_FULL, 0, "full "},
               {v1::MODEL_FORMAT_LITAGS, 0, "own "}};
  for (const auto& [format, light, kind] : cases) {
    grpc::ClientContext context;
    v1::ExportModelRequest request;
    request.set_name(job_);
    request.set_format(format);
    request.set_light(light);
    const auto reader = client_.model->ExportModel(&context, request);
    v1::ExportModelResponse part;
    ASSERT_TRUE(reader->Read(&part));
    const int64_t size = part.header().size_bytes();
    EXPECT_EQ(part.header().iteration(), 10);
    std::string bytes;
    while (reader->Read(&part)) bytes += part.chunk();
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(static_cast<int64_t>(bytes.size()), size);
    EXPECT_THAT(bytes, ::testing::StartsWith("ply\ncomment " + kind));
    EXPECT_THAT(bytes, ::testing::EndsWith("xend"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(data_.tmp()));
}

// The file of an export whose name is gone already; none: empty.
std::string OpenExport() {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    const auto target = std::filesystem::read_symlink(entry.path(), ignored);
    if (target.filename().string().starts_with("export-")) return entry.path();
  }
  return "";
}

TEST_F(ExportApi, AFileThatCannotBeReadToItsEndIsAnError) {
  grpc::ClientContext context;
  v1::ExportModelRequest request;
  request.set_name(job_);
  request.set_format(v1::MODEL_FORMAT_PLY_FULL);
  const auto reader = client_.model->ExportModel(&context, request);
  v1::ExportModelResponse part;
  ASSERT_TRUE(reader->Read(&part));
  // Of three chunks the last two are to come.
  const std::string file = OpenExport();
  ASSERT_EQ(truncate(file.c_str(), 1000), 0) << file;
  while (reader->Read(&part)) {
  }
  EXPECT_REFUSED(reader->Finish(), INTERNAL, "STORE_FAILED", "");
}

TEST_F(ExportApi, ExportsInABadLightAreRefused) {
  const std::pair<v1::ModelFormat, double> cases[] = {
      {v1::MODEL_FORMAT_PLY, kNan}, {v1::MODEL_FORMAT_PLY, -4.5}, {v1::MODEL_FORMAT_PLY_FULL, 0.5}};
  for (const auto& [format, light] : cases) {
    grpc::ClientContext context;
    v1::ExportModelRequest request;
    request.set_name(job_);
    request.set_format(format);
    request.set_light(light);
    const auto reader = client_.model->ExportModel(&context, request);
    v1::ExportModelResponse part;
    EXPECT_FALSE(reader->Read(&part));
    const auto detail = DetailOf(reader->Finish());
    EXPECT_EQ(detail.reason + " " + detail.field, "LIGHT_INVALID light") << format << " " << light;
  }
  EXPECT_TRUE(std::filesystem::is_empty(data_.tmp()));
}

TEST_F(ExportApi, ExportOptionsReachTheScene) {
  v1::ExportModelRequest request;
  request.set_name(job_);
  request.set_format(v1::MODEL_FORMAT_SPZ_V4);
  request.set_light(0.5);
  request.set_exposure_stops(-1);
  request.set_up(v1::UP_AXIS_NEGATIVE_Z);
  request.set_scale(0.25);
  request.mutable_crop()->mutable_max()->set_z(7);
  request.set_max_splats(12);
  request.set_antialiased(true);
  grpc::ClientContext context;
  const auto reader = client_.model->ExportModel(&context, request);
  v1::ExportModelResponse part;
  ASSERT_TRUE(reader->Read(&part));
  EXPECT_EQ(part.header().elements(), 12);
  ASSERT_TRUE(reader->Read(&part));
  EXPECT_THAT(part.chunk(),
              ::testing::StartsWith(absl::StrCat(
                  "ply\ncomment light 0.5 format ", static_cast<int>(SceneFormat::kSpzV4),
                  " max 12 scale 0.25 up ", static_cast<int>(UpAxis::kNegativeZ),
                  " stops -1 crop 7 aa 1 threads 1\n")));
  while (reader->Read(&part)) continue;
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(ExportApi, ExportsThatCannotBeAreRefused) {
  const auto detail = [&](auto change) {
    v1::ExportModelRequest request;
    request.set_name(job_);
    change(&request);
    grpc::ClientContext context;
    const auto reader = client_.model->ExportModel(&context, request);
    v1::ExportModelResponse part;
    EXPECT_FALSE(reader->Read(&part));
    const auto found = DetailOf(reader->Finish());
    return found.reason + " " + found.field;
  };
  using Request = v1::ExportModelRequest;
  EXPECT_EQ(detail([](Request* r) { r->set_format(static_cast<v1::ModelFormat>(99)); }),
            "FORMAT_UNKNOWN format");
  EXPECT_EQ(detail([](Request* r) { r->set_up(static_cast<v1::UpAxis>(99)); }),
            "EXPORT_OPTION_INVALID up");
  EXPECT_EQ(detail([](Request* r) { r->set_scale(0); }), "EXPORT_OPTION_INVALID scale");
  EXPECT_EQ(detail([](Request* r) { r->set_max_splats(-5); }), "EXPORT_OPTION_INVALID max_splats");
  EXPECT_EQ(detail([](Request* r) {
              r->set_format(v1::MODEL_FORMAT_MESH_GLB);
              r->set_max_splats(5);
            }),
            "EXPORT_OPTION_INVALID max_splats");
  EXPECT_EQ(detail([](Request* r) { r->mutable_crop()->mutable_min()->set_x(kNan); }),
            "EXPORT_OPTION_INVALID crop");
  EXPECT_EQ(detail([](Request* r) { r->set_antialiased(true); }),
            "EXPORT_OPTION_INVALID antialiased");
  for (const v1::ModelFormat format : {v1::MODEL_FORMAT_PLY_FULL, v1::MODEL_FORMAT_LITAGS}) {
    EXPECT_EQ(detail([&](Request* r) {
                r->set_format(format);
                r->set_max_splats(5);
              }),
              "EXPORT_OPTION_INVALID format");
  }
  EXPECT_TRUE(std::filesystem::is_empty(data_.tmp()));
}

}  // namespace
}  // namespace litags
