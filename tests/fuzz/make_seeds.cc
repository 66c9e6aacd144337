// Writes the seed corpora: small valid inputs, made by our own writers. `fuzz-seeds FOLDER`
#include <archive.h>
#include <archive_entry.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/io/colmap_io.h"
#include "engine/io/container.h"
#include "engine/io/depth_io.h"
#include "engine/io/dng.h"
#include "engine/io/image_io.h"
#include "engine/io/npy_test_util.h"
#include "engine/io/ply.h"
#include "engine/io/testing_formats.h"
#include "engine/io/transforms_io.h"
#include "engine/pipeline/scene_file.h"
#include "engine/train/train_state.h"
#include "engine/video/testing_video.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "litags/v1/render_service.pb.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/http_seeds.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

class Corpus {
 public:
  explicit Corpus(fs::path root) : root_(std::move(root)) {}

  void Add(const std::string& target, const std::string& name, const std::string& bytes) const {
    fs::create_directories(root_ / target);
    std::ofstream file(root_ / target / name, std::ios::binary);
    file << bytes;
    LITAGS_CHECK(file.good());
  }

 private:
  const fs::path root_;
};

std::string Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

ImageU8 Photo() {
  ImageU8 image(9, 6);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<uint8_t>(7 * i);
  return image;
}

Planes Depth() {
  Planes depth(1, 3, 4);
  for (size_t i = 0; i < depth.data.size(); ++i) depth.data[i] = 1 + 0.25f * static_cast<float>(i);
  return depth;
}

// A JPEG with an EXIF block that turns it.
std::string TurnedJpeg(const std::string& jpeg) {
  using namespace std::string_literals;
  const std::string exif =
      "Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"s;
  std::string block = "\xff\xe1"s;
  block.push_back(0);
  block.push_back(static_cast<char>(exif.size() + 2));
  return jpeg.substr(0, 2) + block + exif + jpeg.substr(2);
}

SparseModel Cameras(bool distorted) {
  SparseModel model;
  for (int i = 0; i < 2; ++i) {
    View view;
    view.name = "000" + std::to_string(i) + ".jpg";
    view.camera.width = 64;
    view.camera.height = 48;
    view.camera.fx = view.camera.fy = 50;
    view.camera.cx = 32;
    view.camera.cy = 24;
    LITAGS_CHECK(view.camera.LookAt({double(i), -1, -4}, {0, 0, 0}, {0, -1, 0}).ok());
    model.views.push_back(view);
    model.distortions.push_back(distorted ? Distortion{0.1, -0.02, 0.001, 0.002} : Distortion{});
  }
  SparsePoint point;
  point.xyz = {0.1, 0.2, 0.3};
  point.track = {{0, 30, 20}, {1, 33, 21}};
  model.points = {point};
  return model;
}

Splats Gaussians() {
  Splats splats(2);
  for (size_t i = 0; i < 2; ++i) {
    splats.at(i, kMean) = 0.5f * static_cast<float>(i);
    for (int r = 0; r < 3; ++r) splats.at(i, kLogScale + r) = -2;
    splats.at(i, kRawQuat) = 1;
  }
  return splats;
}

PdmOptions SmallDenoiser() {
  PdmOptions options;
  options.hidden = 1;
  options.shared = true;
  return options;
}

// The sections of a container, as WriteScratchContainer() takes them.
std::string Sections(const std::string& path, std::string_view kind, uint32_t version) {
  const auto file = Container::Read(path, kind, 1, version);
  LITAGS_CHECK(file.ok());
  std::vector<std::string> pieces;
  for (const std::string& name : file->SectionNames()) {
    pieces.push_back(name);
    pieces.emplace_back(*file->Section(name));
  }
  return JoinPieces(pieces);
}

// A frame of a sensor, 16x12.
std::string Dng() {
  SensorFrame frame;
  frame.width = 16;
  frame.height = 12;
  frame.black = 64;
  frame.white = 1023;
  for (int i = 0; i < 16 * 12; ++i) frame.numbers.push_back(static_cast<uint16_t>(64 + 5 * i));
  frame.neutral = {0.5, 1, 0.6};
  frame.iso = 800;
  return EncodeDng(frame);
}

void AddOtherFormats(const Corpus& corpus) {
  const DeepImage deep = Deepen(Photo());
  const std::string icc = MakeTestProfile(TestProfile::kDisplayP3);
  const std::pair<const char*, std::string> seeds[] = {
      {"photo.webp", EncodeTestWebp(Photo(), {.icc = icc})},
      {"lossy.webp", EncodeTestWebp(Photo(), {}, false)},
      {"photo.tif", EncodeTestTiff(deep, {.bits = 16, .compression = 8, .icc = icc})},
      {"tiled.tif", EncodeTestTiff(deep, {.compression = 5, .tiled = true, .planar = true})},
      {"float.tif", EncodeTestTiff(deep, {.bits = 32, .big = true})},
      {"photo.heic", EncodeTestHeif(deep, false, 8, {.icc = icc})},
      {"deep.heic", EncodeTestHeif(deep, false, 10)},
      {"photo.avif", EncodeTestHeif(deep, true, 12)},
      {"photo.jxl", EncodeTestJxl(deep, 16, {.icc = icc})},
      {"photo.dng", Dng()}};
  for (const auto& [name, bytes] : seeds) {
    corpus.Add("image_header", name, bytes);
    corpus.Add("image_decode", name, bytes);
  }
  for (const auto& [name, kind] : {std::pair{"srgb.icc", TestProfile::kSrgb},
                                   {"adobe.icc", TestProfile::kAdobeRgb},
                                   {"grey.icc", TestProfile::kGreyLinear}}) {
    corpus.Add("color_profile", name, MakeTestProfile(kind));
  }
}

void AddImages(const Corpus& corpus) {
  const std::string png = *EncodePng(Photo()), jpeg = *EncodeJpeg(Photo(), 60);
  const std::string png16 = *EncodePng16(Depth(), 1000), turned = TurnedJpeg(jpeg);
  auto below_black = PhotoFromU8(Photo());
  below_black.data[0] = -500;
  for (const char* target : {"image_header", "image_decode"}) {
    corpus.Add(target, "photo.png", png);
    corpus.Add(target, "photo.jpg", jpeg);
    corpus.Add(target, "turned.jpg", turned);
    corpus.Add(target, "deep.png", png16);
    corpus.Add(target, "below_black.png", *EncodePng16(below_black));
    corpus.Add(target, "cut.jpg", jpeg.substr(0, jpeg.size() / 2));
  }
  AddOtherFormats(corpus);
  corpus.Add("image_header", "exif", turned.substr(12));
  corpus.Add("depth_map", "depth.png", png16);
  corpus.Add("depth_map", "depth.pfm", EncodePfm(Depth()));
  const Planes depth = Depth();
  const std::vector<float> values(depth.data.begin(), depth.data.end());
  corpus.Add("depth_map", "depth.npy", NumpyFile("3, 4", values));
  corpus.Add("depth_map", "half.npy",
             NumpyFile(1, NumpyHeader("<f2", "3, 4"), std::string(24, '\x42')));
}

void AddVideos(const Corpus& corpus) {
  const std::vector<ImageU8> frames = WalkFrames(32, 32, 3, 2);
  TestVideo options;
  options.quarters = 1;
  corpus.Add("video", "h264.mov", EncodeVideo(frames, options));
  for (const auto& [container, codec, name] :
       {std::tuple{"mp4", "mpeg4", "mpeg4.mp4"}, std::tuple{"matroska", "libx265", "hevc.mkv"},
        std::tuple{"webm", "libvpx-vp9", "vp9.webm"}, std::tuple{"avi", "mjpeg", "mjpeg.avi"},
        std::tuple{"mpegts", "mpeg2video", "mpeg2.ts"}}) {
    TestVideo other;
    other.container = container;
    other.codec = codec;
    other.full_range = std::string_view(codec) == "mjpeg";
    other.pixels = other.full_range ? "yuvj420p" : "yuv420p";
    const std::string bytes = EncodeVideo(frames, other);
    LITAGS_CHECK(!bytes.empty());
    corpus.Add("video", name, bytes);
  }
}

// The cameras of other programs, as little of them as is read.
void AddOtherCameras(const Corpus& corpus) {
  corpus.Add("transforms", "openmvg.json", R"({"sfm_data_version": "0.3", "views": [{"key": 0,
"value": {"ptr_wrapper": {"data": {"filename": "a.jpg", "id_intrinsic": 0, "id_pose": 0}}}}],
"intrinsics": [{"key": 0, "value": {"polymorphic_id": 2147483649, "polymorphic_name":
"pinhole_radial_k3", "ptr_wrapper": {"data": {"width": 64, "height": 48, "focal_length": 50.0,
"principal_point": [32.0, 24.0], "disto_k3": [0.1, 0.02, 0.003]}}}}], "extrinsics": [{"key": 0,
"value": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "center": [0, 0, 0]}}]})");
  corpus.Add("transforms", "meshroom.sfm", R"({"version": ["1", "2", "4"], "views": [{"viewId": "1",
"poseId": "1", "intrinsicId": "2", "path": "/a.jpg"}], "intrinsics": [{"intrinsicId": "2", "width":
"64", "height": "48", "sensorWidth": "36", "focalLength": "28", "principalPoint": ["0", "0"],
"type": "radial3", "distortionParams": ["0.1", "0.02", "0.003"]}], "poses": [{"poseId": "1", "pose":
{"transform": {"rotation": ["1", "0", "0", "0", "1", "0", "0", "0", "1"], "center": ["0", "0",
"0"]}}}]})");
  corpus.Add("transforms", "bundle.out",
             "# Bundle file v0.3\n1 1\n50 -0.1 0\n1 0 0\n0 -1 0\n0 0 -1\n0 0 0\n1 2 3\n9 9 9\n"
             "1 0 7 1.5 -2\n\na.jpg\n");
  corpus.Add("transforms", "metashape.xml", R"(<?xml version="1.0"?><document><chunk><sensors>
<sensor id="0" type="frame"><calibration type="frame" class="adjusted"><resolution width="64"
height="48"/><f>50</f><cx>1</cx><cy>2</cy><k1>0.1</k1><p1>0.01</p1></calibration></sensor></sensors>
<cameras><camera id="0" sensor_id="0" component_id="0" label="a.jpg"><transform>1 0 0 0 0 1 0 0 0 0 1
0 0 0 0 1</transform></camera></cameras></chunk></document>)");
}

// The three files of a model as COLMAP writes them.
std::vector<std::string> ColmapText(bool distorted) {
  return {absl::StrCat("# cameras\n1 ",
                       distorted ? "OPENCV 64 48 70 71.5 32 24 0.1 -0.2 0.003 1e-4\n"
                                 : "PINHOLE 64 48 70 71.5 32 24\n2 SIMPLE_RADIAL 4 3 5 2 1.5 0\n"),
          "# images\n2 1 0 0 0 0.5 -1 2e0 1 night/b.jpg\n\n"
          "5 0.5 -0.5 0.5 0.5 0 0 1 1 a b.jpg\n10.5 11 3 12 13.25 -1\n",
          "# points\n3 0.25 -1 4 10 20 30 0.75 5 0\n4 1 1 1 0 0 0 -1\n"};
}

void AddModels(const Corpus& corpus, const fs::path& scratch) {
  SparseModel fisheye = Cameras(true);
  for (Distortion& lens : fisheye.distortions) lens = {.k1 = 0.1, .k4 = 0.001, .fisheye = true};
  corpus.Add("transforms", "fisheye.json", FormatTransforms(fisheye, "low"));
  AddOtherCameras(corpus);
  for (const bool distorted : {false, true}) {
    const std::string name = distorted ? "distorted" : "plain";
    corpus.Add("transforms", name + ".json", FormatTransforms(Cameras(distorted), "low"));
    LITAGS_CHECK(WriteColmapModel(scratch, Cameras(distorted)).ok());
    corpus.Add("colmap_model", name,
               JoinPieces({Read(scratch / "cameras.bin"), Read(scratch / "images.bin"),
                           Read(scratch / "points3D.bin")}));
    corpus.Add("colmap_text", name, JoinPieces(ColmapText(distorted)));
    corpus.Add("ply", distorted ? "lita.ply" : "plain.ply", EncodePly(Gaussians(), distorted));
  }
}

// As WriteScratchScene() takes it: of that version, whichever SaveScene() gives it.
void AddScene(const Corpus& corpus, const fs::path& scratch, const std::string& name,
              const Model& model, uint32_t version) {
  const std::string scene = scratch / "scene";
  LITAGS_CHECK(SaveScene(scene, model, Cameras(false).views).ok());
  corpus.Add("scene", name, static_cast<char>(version - 1) + Sections(scene, "scene", 4));
}

void AddContainers(const Corpus& corpus, const fs::path& scratch) {
  TrainState state;
  state.iteration = 5;
  state.splats = {Gaussians(), Splats(2), Splats(2)};
  state.pdm = state.pdm_moment1 = state.pdm_moment2 = PdmWeights::Zeros(SmallDenoiser());
  state.density.Reset(2);
  state.nan_recoveries = {{3, true, "loss"}};
  const std::string checkpoint = scratch / "checkpoint";
  LITAGS_CHECK(SaveTrainState(checkpoint, "fuzz", state).ok());
  corpus.Add("checkpoint", "two", Sections(checkpoint, "checkpoint", kCheckpointVersion));
  for (const View& view : Cameras(false).views) state.poses.emplace_back(view.camera);
  LITAGS_CHECK(SaveTrainState(checkpoint, "fuzz", state).ok());
  corpus.Add("checkpoint", "refined", Sections(checkpoint, "checkpoint", kCheckpointVersion));
  ContainerWriter small("checkpoint", 2);
  small.AddSection("a", "bytes");
  small.AddSection("numbers", std::string(16, '\1'));
  LITAGS_CHECK(small.Commit(checkpoint).ok());
  corpus.Add("container", "small", Read(checkpoint));

  Model model;
  model.splats = Gaussians();
  model.pdm_options = SmallDenoiser();
  model.pdm = PdmWeights::Zeros(SmallDenoiser());
  AddScene(corpus, scratch, "two", model, 2);
  AddScene(corpus, scratch, "without_filter", model, 1);
  model.origin = {5e5, 4.6e6, 120};
  AddScene(corpus, scratch, "far", model, 3);
  model.near_plane = 0.01f;
  AddScene(corpus, scratch, "near_plane", model, 4);
}

void AddRequests(const Corpus& corpus) {
  v1::CreateJobRequest job;
  v1::JobOptions& options = *job.mutable_options();
  options.set_method(v1::METHOD_LITAGS);
  options.set_tone(v1::TONE_PAPER);
  options.set_iterations(100);
  options.set_min_registered(0.5);
  job.mutable_policy()->set_priority(3);
  job.mutable_policy()->mutable_retention()->set_seconds(60);
  corpus.Add("request", "job", '\0' + job.SerializeAsString());

  v1::RenderViewRequest view;
  view.set_name("jobs/0123456789abcdef");
  view.mutable_pose()->set_camera("a.png");
  view.mutable_settings()->set_width(32);
  view.mutable_settings()->set_vertical_fov_deg(50);
  corpus.Add("request", "camera", '\1' + view.SerializeAsString());
  auto* look_at = view.mutable_pose()->mutable_look_at();
  look_at->mutable_eye()->set_z(-4);
  look_at->mutable_target()->set_x(1);
  view.mutable_settings()->set_channel(v1::CHANNEL_LIGHT);
  view.mutable_settings()->set_light(0.5);
  corpus.Add("request", "look_at", '\1' + view.SerializeAsString());
  for (int i = 0; i < 16; ++i) view.mutable_pose()->mutable_viewmat()->add_values(i % 5 == 0);
  auto* lens = view.mutable_settings()->mutable_intrinsics();
  lens->set_fx(30);
  lens->set_fy(30);
  lens->set_cx(16);
  lens->set_cy(12);
  corpus.Add("request", "viewmat", '\1' + view.SerializeAsString());

  v1::RenderPathRequest path;
  path.set_frames(3);
  path.mutable_keyframes()->add_poses()->set_camera("a.png");
  path.mutable_keyframes()->add_poses()->set_camera("b.png");
  corpus.Add("request", "keyframes", '\2' + path.SerializeAsString());
  path.mutable_orbit()->set_sweep_deg(90);
  path.mutable_light()->set_last(1);
  corpus.Add("request", "orbit", '\2' + path.SerializeAsString());

  v1::FileHeader file;
  file.set_file_name("a.png");
  file.set_size_bytes(4096);
  file.set_sha256(std::string(32, 's'));
  file.set_offset(17);
  corpus.Add("request", "file", '\3' + file.SerializeAsString());
}

enum class Packing { kZip, kTar, kTarGz };

// A small folder, as other programs pack it.
std::string Pack(Packing packing) {
  const std::pair<const char*, std::string> files[] = {{"night/images/a.png", *EncodePng(Photo())},
                                                       {"night/depth/a.pfm", EncodePfm(Depth())},
                                                       {"night/README.txt", "taken at night"}};
  std::string out(64 << 10, '\0');
  size_t used = 0;
  archive* writer = archive_write_new();
  if (packing == Packing::kZip) {
    archive_write_set_format_zip(writer);
  } else {
    archive_write_set_format_ustar(writer);
    if (packing == Packing::kTarGz) {
      archive_write_add_filter_gzip(writer);
      archive_write_set_filter_option(writer, "gzip", "timestamp", nullptr);  // the same each time
    }
  }
  archive_write_open_memory(writer, out.data(), out.size(), &used);
  for (const auto& [name, bytes] : files) {
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, name);
    archive_entry_set_filetype(entry, AE_IFREG);
    archive_entry_set_perm(entry, 0644);
    archive_entry_set_size(entry, static_cast<la_int64_t>(bytes.size()));
    LITAGS_CHECK(archive_write_header(writer, entry) == ARCHIVE_OK);
    archive_write_data(writer, bytes.data(), bytes.size());
    archive_entry_free(entry);
  }
  archive_write_close(writer);
  archive_write_free(writer);
  out.resize(used);
  return out;
}

void AddArchives(const Corpus& corpus) {
  corpus.Add("archive", "night.zip", Pack(Packing::kZip));
  corpus.Add("archive", "night.tar.gz", Pack(Packing::kTarGz));
  // Without the zeros that fill its last block.
  corpus.Add("archive", "night.tar", Pack(Packing::kTar).substr(0, 4096));
}

// Packets of server/reader, each behind a byte of its length.
void AddReaderAnswers(const Corpus& corpus) {
  const auto packets = [](std::initializer_list<std::string> list) {
    std::string bytes;
    for (const std::string& packet : list) bytes += static_cast<char>(packet.size()) + packet;
    return bytes;
  };
  const std::string nul(1, '\0');
  const std::string good = "V0" + nul + nul + nul + nul + "64" + nul + "48" + nul +
                           "1 35 0.0333333 800 1.8 12.25 0.0041 0.93 0123456789abcdef";
  corpus.Add("reader_answers", "photo", packets({good}));
  corpus.Add("reader_answers", "refused",
             packets({"V3" + nul + "IMAGE_CORRUPT" + nul + "images[x]" + nul + "why" + nul + "0" +
                      nul + "0" + nul}));
  corpus.Add("reader_answers", "archive",
             packets({"Elow" + nul + "1.jpg", "Bbytes", "Bmore", "F", "Eother.txt",
                      "Emasks" + nul + "1.png", "F", good}));
}

}  // namespace
}  // namespace litags

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: fuzz-seeds FOLDER\n");
    return 2;
  }
  const litags::Corpus corpus(argv[1]);
  const std::filesystem::path scratch = std::filesystem::path(litags::ScratchPath()).parent_path();
  litags::AddImages(corpus);
  litags::AddVideos(corpus);
  litags::AddModels(corpus, scratch);
  litags::AddContainers(corpus, scratch);
  litags::AddRequests(corpus);
  litags::AddArchives(corpus);
  litags::AddReaderAnswers(corpus);
  for (const auto& [name, bytes] : litags::HttpSeeds()) corpus.Add("http", name, bytes);
  return 0;
}
