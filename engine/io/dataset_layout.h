// Folders and archives as nerfstudio, 3DGS and Mip-NeRF 360 lay them out: one capture, with several
// copies of its photos and several files of its cameras.
#ifndef LITAGS_ENGINE_IO_DATASET_LAYOUT_H_
#define LITAGS_ENGINE_IO_DATASET_LAYOUT_H_

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace litags {

struct DatasetFile {
  enum class Kind {
    kPhoto,
    kCameras,  // a file of cameras: transforms.json
    kModel,    // of a COLMAP model: images.bin
    kMask,
    kDepth,
    kOther,  // what is not read
  };
  std::string folder;  // "garden/images"; empty: the top
  std::string name;
  Kind kind = Kind::kOther;
  int64_t bytes = 0;  // only those of a model's images.bin and images.txt matter

  std::string Path() const { return folder.empty() ? name : folder + "/" + name; }
};

// What of a dataset is used: the photos of one size, and one file or COLMAP model of cameras.
// docs/datasets.md says by which rules. Where they do not tell, all files are used.
class DatasetLayout {
 public:
  explicit DatasetLayout(const std::vector<DatasetFile>& files);

  bool Uses(const DatasetFile& file) const;
  // What a file is called among all of its kind: where photos in folders of `photos()` share a
  // name, as those of a rig, theirs, their masks' and their depth maps' have these folders in
  // front, joined by '_', as cameras find them: images/cam0/0001.png is "cam0_0001.png".
  std::string NameOf(const DatasetFile& file) const;

  // "garden/images", where the photos lie, or in folders of it; empty: no folder has such a name.
  const std::string& photos() const { return photos_; }
  // The file, or the folder of the model; nullopt: there is none, or the rules do not tell which.
  const std::optional<std::string>& cameras() const { return cameras_; }
  bool cameras_are_ambiguous() const { return !cameras_ && sources_ > 1; }
  // "garden/images_2/ (the photos are those in garden/images/)", in order.
  std::vector<std::string> Notes() const;

 private:
  void ChoosePhotos(const std::vector<DatasetFile>& files);
  void LookForRig(const std::vector<DatasetFile>& files);
  void ChooseCameras(const std::vector<DatasetFile>& files);
  bool IsInLeftOutFolder(const std::string& folder) const;

  std::string photos_;
  bool is_rig_ = false;  // photos in folders of photos_ share names
  std::optional<std::string> cameras_;
  size_t sources_ = 0;                             // of cameras, outside of left out folders
  std::map<std::string, std::string> folders_;     // left out, with all that is in them: why
  std::map<std::string, std::string> no_cameras_;  // paths of files and models: why
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_DATASET_LAYOUT_H_
