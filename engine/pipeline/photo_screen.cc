#include "engine/pipeline/photo_screen.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/photo_names.h"
#include "engine/io/alpha_mask.h"
#include "engine/io/cameras_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_header.h"
#include "engine/io/image_io.h"
#include "engine/io/transforms_io.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/black_bars.h"
#include "engine/pipeline/photo_place.h"
#include "engine/pipeline/photo_progress.h"
#include "engine/pipeline/wide_photos.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct Decoded {
  absl::Status status, mask_status;
  ScreenedPhoto photo;
  LineKinds lines;
  std::string alpha;  // its mask as EncodeMask has it: masks of all photos are kept at once
  bool blocks = false, no_end_mark = false;  // blocks: the format may compress in them
};

// `mask`: the path of the photo's; empty: it has none. What a photo shows is told by what counts.
Decoded Decode(const std::string& dir, const std::string& name, const std::string& mask) {
  Decoded d;
  d.photo.name = name;
  // Models of cameras are written and read by it.
  d.status = ValidateFileName(name, PhotoField(name));
  if (!d.status.ok()) return d;
  const auto bytes = ReadFile(dir + "/" + name, PhotoField(name), ImageLimits().max_bytes);
  d.status = bytes.status();
  if (!bytes.ok()) return d;
  absl::StatusOr<Photo> photo = DecodePhoto(*bytes, PhotoField(name));
  d.status = photo.status();
  if (!photo.ok()) return d;
  d.lines = KindsOfLines(*photo);
  if (!mask.empty()) {
    const absl::StatusOr<PlaneU8> counts = ReadMask(mask, photo->width, photo->height);
    d.mask_status = counts.status();
    if (counts.ok()) FillMasked(*counts, &*photo);
  }
  d.photo = LookAt(name, *photo);
  d.photo.has_views = StatesViews(*bytes, photo->width, photo->height);
  d.no_end_mark = IsJpeg(*bytes) && LacksJpegEnd(*bytes);
  d.photo.info = ReadImageInfo(*bytes, PhotoField(name)).value_or(ImageInfo());
  const ImageInfo& info = d.photo.info;
  // A PNG of fewer bits than it has room for was made of another file, as of a video's frame.
  d.blocks = !IsPng(*bytes) || SignificantBits(info) < info.bit_depth;
  const PlaneU8 alpha = AlphaMask(*bytes, info.orientation);
  if (alpha.empty()) return d;
  absl::StatusOr<std::string> png = EncodeMask(alpha);
  d.status = png.status();
  if (png.ok()) d.alpha = *std::move(png);
  return d;
}

// The photo that a file beside it is a mask of, by its name: 0001.jpg.png, 0001_mask.png,
// 0001.mask.png, dynamic_mask_0001.png (of instant-ngp: what is not 0 there does not count).
std::optional<size_t> PhotoOfMask(const std::string& name, const NameIndex& index) {
  constexpr absl::string_view kDynamic = "dynamic_mask_";
  if (!absl::EndsWithIgnoreCase(name, ".png")) return std::nullopt;
  std::string wanted = name.substr(0, name.size() - 4);
  if (absl::StartsWith(wanted, kDynamic)) {
    wanted = wanted.substr(kDynamic.size());
  } else if (absl::EndsWithIgnoreCase(wanted, "_mask") ||
             absl::EndsWithIgnoreCase(wanted, ".mask")) {
    wanted.resize(wanted.size() - 5);
  } else if (!index.FindExact(wanted).has_value()) {
    return std::nullopt;
  }
  const std::optional<size_t> photo = index.Find(wanted);
  return photo == index.FindExact(name) ? std::nullopt : photo;
}

absl::StatusOr<std::string> WriteMask(const ReconstructInput& input, const std::string& photo,
                                      const PlaneU8& mask) {
  const std::string dir = input.work_dir + "/found_masks";
  LITAGS_RETURN_IF_ERROR(MakeOwnFolder(dir));
  const std::string path = absl::StrCat(dir, "/", photo, ".png");
  LITAGS_ASSIGN_OR_RETURN(const std::string png, EncodeMask(mask));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(path, png));
  return path;
}

// Where a mask of the cameras' file lies: beside that file or the photos, and nowhere above, or
// among the masks, which are in one folder.
std::string FindMaskPath(const ReconstructInput& input, const fs::path& cameras_dir,
                         std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  const fs::path given(path);
  if (given.is_absolute()) return "";
  for (const fs::path& part : given) {
    if (part == "..") return "";
  }
  for (const fs::path& dir : {cameras_dir, fs::path(input.images_dir), fs::path(input.masks_dir)}) {
    std::error_code ignored;
    if (!dir.empty() && fs::is_regular_file(dir / given, ignored)) return dir / given;
  }
  if (input.masks_dir.empty()) return "";
  for (const std::string& name : NamesInOneFolder(path)) {
    std::error_code ignored;
    const fs::path mask = fs::path(input.masks_dir) / name;
    if (fs::is_regular_file(mask, ignored)) return mask;
  }
  return "";
}

// What the cameras' file says of a photo's mask.
struct NamedMask {
  std::string view;   // as the file calls the photo
  std::string path;   // as the file has it; empty: it names none
  std::string found;  // where it lies; empty: it is not there
};

std::vector<NamedMask> MasksOfCameras(const ReconstructInput& input) {
  std::error_code ignored;
  const std::string cameras = ResolveCameras(input.cameras_path);
  if (!fs::is_regular_file(cameras, ignored)) return {};
  const auto json = ReadFile(cameras, "cameras", kMaxCamerasBytes);
  if (!json.ok()) return {};  // the reader of cameras says so
  const fs::path beside = fs::absolute(cameras, ignored).parent_path();
  std::vector<NamedMask> masks;
  for (const auto& [view, path] : MaskPathsOfTransforms(*json)) {
    masks.push_back({view, path, path.empty() ? "" : FindMaskPath(input, beside, path)});
  }
  return masks;
}

// The names of those that lie in a folder.
std::set<std::string> NamesIn(const std::string& dir, const std::vector<NamedMask>& masks) {
  std::set<std::string> names;
  for (const NamedMask& mask : masks) {
    std::error_code ignored;
    const fs::path found(mask.found);
    if (fs::equivalent(found.parent_path(), dir, ignored)) names.insert(found.filename());
  }
  return names;
}

// The photo of each: names that are the same go first, as for cameras, so that no photo gets the
// mask of another camera's.
std::vector<std::optional<size_t>> PhotosOf(const std::vector<NamedMask>& masks,
                                            const NameIndex& index) {
  std::vector<std::optional<size_t>> photos;
  std::set<size_t> taken;
  for (const NamedMask& mask : masks) {
    photos.push_back(index.FindExact(mask.view));
    if (photos.back().has_value()) taken.insert(*photos.back());
  }
  for (size_t i = 0; i < masks.size(); ++i) {
    if (photos[i].has_value()) continue;
    std::vector<size_t> meant = index.FindAlike(masks[i].view);
    std::erase_if(meant, [&](size_t photo) { return taken.contains(photo); });
    if (!meant.empty()) photos[i] = meant[0];
  }
  return photos;
}

// Gives them to the photos that have none.
void AddNamedMasks(const std::vector<NamedMask>& masks, PhotoList* list) {
  const std::vector<std::optional<size_t>> photos = PhotosOf(masks, NameIndex(list->names));
  int used = 0;
  std::vector<std::string> missing;
  for (size_t i = 0; i < masks.size(); ++i) {
    const NamedMask& mask = masks[i];
    const std::optional<size_t> photo = photos[i];
    if (mask.path.empty() || !photo.has_value()) continue;
    if (list->masks.contains(list->names[*photo])) continue;
    if (mask.found.empty()) {
      missing.push_back(mask.path);
    } else {
      list->masks[list->names[*photo]] = mask.found;
      ++used;
    }
  }
  if (used > 0) {
    list->notes.push_back(absl::StrCat(Counted(used, "mask"), used == 1 ? " is that" : " are those",
                                       " that the cameras' file names"));
  }
  if (!missing.empty()) {
    list->notes.push_back(
        absl::StrCat("the cameras' file names masks of ", Counted(missing.size(), "photo"),
                     missing.size() == 1 ? " that is not there, " : " that are not there, such as ",
                     missing[0], ": what they hide is learnt; give their folder with --masks"));
  }
}

// Files among the photos that are masks of others by their names.
absl::Status TakeMasksBeside(const ReconstructInput& input, PhotoList* list) {
  const NameIndex index(list->names);
  std::vector<std::string> photos;
  int masks = 0;
  std::string some;
  for (const std::string& name : list->names) {
    const std::optional<size_t> of = PhotoOfMask(name, index);
    if (!of.has_value()) {
      photos.push_back(name);
      continue;
    }
    const std::string& photo = list->names[*of];
    ++masks;
    some = name;
    if (list->masks.contains(photo)) continue;
    std::string path = input.images_dir + "/" + name;
    if (absl::StartsWith(name, "dynamic_mask_")) {
      const absl::StatusOr<ImageU8> moving = ReadImage(path, PhotoField(name));
      LITAGS_RETURN_IF_ERROR(moving.status());
      PlaneU8 mask(moving->width, moving->height);
      for (size_t i = 0; i < mask.data.size(); ++i) {
        const uint8_t* pixel = &moving->data[3 * i];
        mask.data[i] = pixel[0] == 0 && pixel[1] == 0 && pixel[2] == 0 ? kCounts : 0;
      }
      LITAGS_ASSIGN_OR_RETURN(path, WriteMask(input, photo, mask));
    }
    list->masks[photo] = path;
  }
  if (masks > 0) {
    list->notes.push_back(
        absl::StrCat(Counted(masks, "file"), " among the photos, such as ", some,
                     masks == 1 ? ", is a mask of another by its name, and no photo"
                                : ", are masks of others by their names, and no photos"));
  }
  list->names = std::move(photos);
  return absl::OkStatus();
}

// Bars of photos of one size, of which there are some.
std::map<std::pair<int, int>, BarFrame> BarsBySize(const std::vector<Decoded>& used,
                                                   std::vector<std::string>* notes) {
  std::map<std::pair<int, int>, std::vector<const LineKinds*>> lines;
  std::map<std::pair<int, int>, bool> blocks;
  for (const Decoded& d : used) {
    const std::pair size(d.photo.width, d.photo.height);
    lines[size].push_back(&d.lines);
    blocks[size] |= d.blocks;
  }
  std::map<std::pair<int, int>, BarFrame> frames;
  for (const auto& [size, photos] : lines) {
    const std::optional<BarFrame> frame = FindBars(photos, blocks[size]);
    if (!frame.has_value()) continue;
    frames[size] = *frame;
    notes->push_back(absl::StrCat(DescribeBars(*frame, size.first, size.second),
                                  " are black in all ", photos.size(), " photos of ", size.first,
                                  "x", size.second, " px: bars, which are masked"));
  }
  return frames;
}

void CutTo(const BarFrame& frame, PlaneU8* mask) {
  for (int y = 0; y < mask->height; ++y) {
    for (int x = 0; x < mask->width; ++x) {
      const bool in = y >= frame.rows.first && y < frame.rows.last && x >= frame.columns.first &&
                      x < frame.columns.last;
      if (!in) mask->data[size_t(y) * mask->width + x] = 0;
    }
  }
}

// Masks of alpha channels and of bars, joined with those that photos have.
absl::Status AddFoundMasks(const ReconstructInput& input, const std::vector<Decoded>& used,
                           PhotoScreen* screen) {
  const auto frames = BarsBySize(used, &screen->notes);
  int transparent = 0;
  for (const Decoded& d : used) {
    const auto frame = frames.find({d.photo.width, d.photo.height});
    if (d.alpha.empty() && frame == frames.end()) continue;
    PlaneU8 mask(d.photo.width, d.photo.height);
    if (d.alpha.empty()) {
      std::fill(mask.data.begin(), mask.data.end(), kCounts);
    } else {
      LITAGS_ASSIGN_OR_RETURN(mask, DecodeMask(d.alpha, PhotoField(d.photo.name)));
      ++transparent;
    }
    if (frame != frames.end()) CutTo(frame->second, &mask);
    if (const auto given = screen->masks.find(d.photo.name); given != screen->masks.end()) {
      LITAGS_ASSIGN_OR_RETURN(const PlaneU8 other,
                              ReadMask(given->second, mask.width, mask.height));
      for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] &= other.data[i];
    }
    LITAGS_ASSIGN_OR_RETURN(screen->masks[d.photo.name], WriteMask(input, d.photo.name, mask));
  }
  if (transparent > 0) {
    screen->notes.push_back(absl::StrCat(Counted(transparent, "photo"),
                                         transparent == 1 ? " is" : " are",
                                         " transparent in places: what is, does not count"));
  }
  return absl::OkStatus();
}

// Phones' RAW has them.
void NoteGainMaps(const std::vector<ScreenedPhoto>& photos, std::vector<std::string>* notes) {
  const auto has = [](const ScreenedPhoto& photo) { return photo.info.has_gain_map; };
  const auto first = std::find_if(photos.begin(), photos.end(), has);
  if (first == photos.end()) return;
  const auto count = std::count_if(photos.begin(), photos.end(), has);
  notes->push_back(absl::StrCat("the map of the lens's shading (DNG's GainMap) of ",
                                Counted(count, "photo"), ", such as ", first->name,
                                ", is not applied: corners may be darker"));
}

// They would be learnt as colours.
void NoteGrey(const std::vector<ScreenedPhoto>& photos, std::vector<std::string>* notes) {
  const auto is_grey = [](const ScreenedPhoto& photo) { return photo.grey; };
  const auto first = std::find_if(photos.begin(), photos.end(), is_grey);
  const auto grey = static_cast<size_t>(std::count_if(photos.begin(), photos.end(), is_grey));
  if (grey == 0 || grey == photos.size()) return;
  notes->push_back(absl::StrCat(grey, " of ", photos.size(), " photos ",
                                grey == 1 ? "has no colour: " : "have no colour, such as ",
                                first->name,
                                "; the scene's colours fade by them: leave them out if colours "
                                "matter"));
}

// Views of one photo are as sharp as its sharpest: of the sky there is little fine detail.
void ShareDetail(const RigViews& rig_views, std::vector<ScreenedPhoto>* photos) {
  std::map<std::string, PhotoDetail> sharpest;  // by the photo
  for (const bool share : {false, true}) {
    for (ScreenedPhoto& photo : *photos) {
      const auto view = rig_views.find(photo.name);
      if (view == rig_views.end()) continue;
      PhotoDetail& most = sharpest[view->second.rig];
      if (share) {
        photo.detail = most;
      } else if (photo.detail.fine > most.fine) {
        most = photo.detail;
      }
    }
  }
}

// KeysOf() the paths of the given cameras' photos.
std::set<std::string> KeysOfCameras(const ReconstructInput& input) {
  std::set<std::string> keys;
  if (input.cameras_path.empty()) return keys;
  const PhotoSizes sizes = [](const std::string&) {
    return PhotoSize{kMaxImageSide, kMaxImageSide};  // shows all points
  };
  PanoramaNames panoramas;
  const absl::StatusOr<SparseModel> cameras =
      ReadCameras(ResolveCameras(input.cameras_path), "cameras", sizes, &panoramas);
  if (!cameras.ok()) return keys;  // whoever needs them says why
  for (size_t i = 0; i < cameras->views.size(); ++i) {
    for (std::string& key : KeysOf(cameras->PathOf(i))) keys.insert(std::move(key));
  }
  return keys;
}

// Which copies given cameras and depth maps name. Where there are none, cameras are not read.
void MarkNamed(const ReconstructInput& input, std::vector<ScreenedPhoto>* photos) {
  if (!HasCopies(*photos)) return;
  const std::set<std::string> keys = KeysOfCameras(input);
  for (ScreenedPhoto& photo : *photos) {
    photo.named_by_cameras =
        HowNamed(photo.name, [&](const std::string& key) { return keys.contains(key); });
    photo.has_depth_map =
        !input.depth_dir.empty() && !FindDepthMap(input.depth_dir, photo.name).empty();
  }
}

}  // namespace

std::vector<std::string> PhotoScreen::Names() const {
  std::vector<std::string> names;
  for (const ScreenedPhoto& photo : photos) names.push_back(photo.name);
  return names;
}

std::vector<std::string> PhotosAmong(const std::vector<std::string>& names) {
  const NameIndex index(names);
  std::vector<std::string> photos = names;
  std::erase_if(photos,
                [&](const std::string& name) { return PhotoOfMask(name, index).has_value(); });
  return photos;
}

absl::Status CheckPhotosLeft(size_t used, absl::Span<const PhotoLeftOut> left_out) {
  const absl::Status status = CheckPhotoCount(used, used + left_out.size());
  if (status.ok() || left_out.empty()) return status;
  const PhotoLeftOut& first = left_out.front();
  return MakeError(status.code(), "TOO_FEW_PHOTOS", "images",
                   absl::StrCat(status.message(), "; left out: ", first.name, ": ", first.why));
}

absl::StatusOr<PhotoList> ListPhotosAndMasks(const ReconstructInput& input) {
  PhotoList list;
  LITAGS_ASSIGN_OR_RETURN(list.names, ListPhotos(input.images_dir, "images"));
  const std::vector<NamedMask> named = MasksOfCameras(input);
  if (!input.masks_dir.empty()) {
    // Of all photos: a mask of one that is left out is no error.
    LITAGS_ASSIGN_OR_RETURN(
        list.masks, FindMasks(input.masks_dir, list.names, NamesIn(input.masks_dir, named)));
  }
  AddNamedMasks(named, &list);
  LITAGS_RETURN_IF_ERROR(TakeMasksBeside(input, &list));
  return list;
}

absl::StatusOr<PhotoScreen> ScreenPhotos(const CutInput& input, int threads,
                                         const CancelToken& cancel,
                                         const std::function<void(const std::string&)>& progress) {
  LITAGS_ASSIGN_OR_RETURN(PhotoList list, ListPhotosAndMasks(input));
  const std::vector<std::string>& names = list.names;
  PhotoScreen screen;
  screen.masks = std::move(list.masks);
  screen.notes = std::move(list.notes);
  std::vector<Decoded> decoded(names.size());
  PhotoProgress read(progress, "reading photos", names.size());
  ParallelFor(threads, names.size(), [&](size_t i, int thread) {
    if (cancel.IsCancelled()) return;
    const auto mask = screen.masks.find(names[i]);
    decoded[i] = Decode(input.images_dir, names[i], mask == screen.masks.end() ? "" : mask->second);
    decoded[i].photo.has_views &= input.cameras_path.empty();
    read.Done(thread);
  });
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  std::vector<ScreenedPhoto> readable;
  for (const Decoded& d : decoded) {
    if (d.status.ok()) readable.push_back(d.photo);
  }
  ShareDetail(input.rig_views, &readable);
  MarkNamed(input, &readable);
  const std::vector<std::string> why = WhyLeftOut(readable);
  std::vector<Decoded> used;
  size_t next = 0;  // of those
  for (Decoded& d : decoded) {
    if (!d.status.ok()) {
      screen.left_out.push_back({d.photo.name, std::string(d.status.message()), true});
    } else if (const std::string& reason = why[next++]; !reason.empty()) {
      screen.left_out.push_back({d.photo.name, reason});
    } else {
      LITAGS_RETURN_IF_ERROR(d.mask_status);
      if (d.no_end_mark) {
        screen.notes.push_back(absl::StrCat(
            d.photo.name, " ends without its end mark; all its pixels are there, and used"));
      }
      used.push_back(std::move(d));
    }
  }
  LITAGS_RETURN_IF_ERROR(AddFoundMasks(input, used, &screen));
  for (Decoded& d : used) screen.photos.push_back(std::move(d.photo));
  NoteGrey(screen.photos, &screen.notes);
  NoteGainMaps(screen.photos, &screen.notes);
  for (const PhotoLeftOut& photo : screen.left_out) {
    screen.masks.erase(photo.name);
    screen.notes.push_back(photo.unreadable
                               ? absl::StrCat(photo.name, " is left out: ", photo.why)
                               : absl::StrCat(photo.name, " is left out: it ", photo.why));
  }
  return screen;
}

}  // namespace litags
