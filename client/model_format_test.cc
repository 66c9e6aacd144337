#include "client/model_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/status.h"
#include "proto/litags/v1/limits.h"

namespace litags::client {
namespace {

using ::testing::HasSubstr;

TEST(ModelFormat, EveryFormatHasAName) {
  std::set<v1::ModelFormat> formats;
  for (const std::string& name : ModelFormatNames()) {
    const auto format = ParseModelFormat(name);
    ASSERT_TRUE(format.ok()) << format.status();
    formats.insert(*format);
  }
  EXPECT_EQ(formats.size(), static_cast<size_t>(v1::ModelFormat_descriptor()->value_count() - 1));
  EXPECT_EQ(ParseModelFormat("spz-v4").value(), v1::MODEL_FORMAT_SPZ_V4);
  for (const char* name : {"", "unspecified", "obj", "model-format-ply"}) {
    EXPECT_EQ(DetailOf(ParseModelFormat(name).status()).reason(), "MODEL_FORMAT_UNKNOWN") << name;
  }
}

TEST(ModelFormat, EndingsSayTheFormat) {
  EXPECT_EQ(ModelFormatOf("a/b.ply").value(), v1::MODEL_FORMAT_PLY);
  EXPECT_EQ(ModelFormatOf("a/b.points.ply").value(), v1::MODEL_FORMAT_POINTS);
  EXPECT_EQ(ModelFormatOf("b.LAS").value(), v1::MODEL_FORMAT_LAS);
  EXPECT_EQ(ModelFormatOf("site.mesh.ply").value(), v1::MODEL_FORMAT_MESH_PLY);
  EXPECT_EQ(ModelFormatOf("site.mesh.glb").value(), v1::MODEL_FORMAT_MESH_GLB);
  EXPECT_EQ(ModelFormatOf("site.html").value(), v1::MODEL_FORMAT_HTML);
  EXPECT_EQ(ModelFormatOf("site.glb").value(), v1::MODEL_FORMAT_GLB);
  EXPECT_EQ(ModelFormatOf("scene.compressed.ply").value(), v1::MODEL_FORMAT_COMPRESSED_PLY);
  EXPECT_EQ(ModelFormatOf("SCENE.SPZ").value(), v1::MODEL_FORMAT_SPZ);
  EXPECT_EQ(ModelFormatOf("x.zip").value(), v1::MODEL_FORMAT_COLMAP);
  EXPECT_EQ(ModelFormatOf("scene.litags").value(), v1::MODEL_FORMAT_LITAGS);
  for (const char* path : {"", "scene", "scene.obj", "ply"}) {
    EXPECT_EQ(DetailOf(ModelFormatOf(path).status()).reason(), "MODEL_FORMAT_UNKNOWN") << path;
  }
}

TEST(ModelFormat, FilesOfServersEndAsTheirFormats) {
  ASSERT_EQ(v1::kModelEndings.size(), static_cast<size_t>(v1::ModelFormat_ARRAYSIZE));
  for (int i = 1; i < v1::ModelFormat_ARRAYSIZE; ++i) {
    const std::string name = "a" + std::string(v1::kModelEndings[i]);
    EXPECT_TRUE(CheckEnding(name, static_cast<v1::ModelFormat>(i)).ok()) << name;
    const auto of_name = ModelFormatOf(name);
    ASSERT_TRUE(of_name.ok()) << of_name.status();
    EXPECT_EQ(v1::kModelEndings[*of_name], v1::kModelEndings[i]);
  }
}

TEST(ModelFormat, AnEndingOfAnotherFormatIsRefused) {
  for (const auto& [path, format] : std::vector<std::pair<const char*, v1::ModelFormat>>{
           {"a.spz", v1::MODEL_FORMAT_SPZ_V4},
           {"a.ply", v1::MODEL_FORMAT_PLY_FULL},
           {"a.ply", v1::MODEL_FORMAT_POINTS},
           {"a.GLB", v1::MODEL_FORMAT_MESH_GLB},
           {"a.zip", v1::MODEL_FORMAT_COLMAP},
           {"/dev/stdout", v1::MODEL_FORMAT_HTML}}) {
    EXPECT_TRUE(CheckEnding(path, format).ok()) << path;
  }
  const absl::Status status = CheckEnding("a.spz", v1::MODEL_FORMAT_PLY_FULL);
  EXPECT_EQ(DetailOf(status).reason(), "MODEL_FORMAT_CONFLICT");
  EXPECT_EQ(std::string(status.message()),
            "a.spz: what is asked for is ply-full, not .spz; call it a.ply, or leave --format "
            "out");
  EXPECT_FALSE(CheckEnding("a.ply", v1::MODEL_FORMAT_HTML).ok());
  EXPECT_THAT(std::string(CheckEnding("a.Compressed.ply", v1::MODEL_FORMAT_PLY).message()),
              HasSubstr("is ply, not .compressed.ply; call it a.ply, or"));
  EXPECT_FALSE(CheckEnding("a.POINTS.ply", v1::MODEL_FORMAT_MESH_PLY).ok());
  EXPECT_TRUE(CheckEnding("a.POINTS.ply", v1::MODEL_FORMAT_POINTS).ok());
}

TEST(ModelFormat, SaysWhatIsCounted) {
  EXPECT_STREQ(ContentOf(v1::MODEL_FORMAT_GLB), "Gaussians");
  EXPECT_STREQ(ContentOf(v1::MODEL_FORMAT_LAS), "points");
  EXPECT_STREQ(ContentOf(v1::MODEL_FORMAT_MESH_GLB), "triangles");
}

TEST(ModelFormat, AxesByWords) {
  EXPECT_EQ(ParseUpAxis("-y").value(), v1::UP_AXIS_NEGATIVE_Y);
  EXPECT_EQ(ParseUpAxis("keep").value(), v1::UP_AXIS_KEEP);
  EXPECT_EQ(DetailOf(ParseUpAxis("up").status()).reason(), "UP_AXIS_UNKNOWN");
}

}  // namespace
}  // namespace litags::client
