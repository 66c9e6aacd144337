// A stand-in for COLMAP in tests: a shell script that records its calls and hands out a database
// and models that the test made.
#ifndef LITAGS_ENGINE_SFM_FAKE_COLMAP_H_
#define LITAGS_ENGINE_SFM_FAKE_COLMAP_H_

#include <array>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/io/sparse_model.h"

namespace litags {

class FakeColmap {
 public:
  FakeColmap();   // in a temporary folder
  ~FakeColmap();  // removes it

  std::string dir() const { return dir_; }
  std::string database() const { return dir_ + "/database.db"; }
  std::string program() const { return dir_ + "/colmap"; }

  // What `help` says that it is; 3.8 without this.
  void SetVersion(const std::string& version) const;

  // Photos dir()/photos/p0.png, p1.png ... of one sRGB level with some texture.
  std::string MakePhotos(int count, int width, int height, int level) const;

  // Shell code run at the start of `command` ("mapper"); $rung, $db, $out, $images, $list, $in
  // are set, and $room, the rung's folder, the only one that it can write to: what is called .log
  // in it stays. `note WORDS` adds to Calls(), and the database in $found replaces the one below.
  void On(const std::string& command, const std::string& shell_code) const;

  // The database that feature_extractor leaves: image ids 1.. in the order of `names`, each with
  // the same `features` (up to 1024, each unlike the others) at the same places, so that feature i
  // matches feature i; pairs (of indices into names) are verified.
  void SetDatabase(const std::vector<std::string>& names, int features,
                   const std::vector<std::pair<int, int>>& pairs) const;

  // Moves its features to where the copies' cameras, in id order, see FakeWorldPoint(0), (1), ...
  void SeeWorldPoints(const std::vector<Camera>& cameras, int features) const;

  // Runs SQL statements on that database.
  void Execute(const std::string& sql) const;

  // Adds a model that the mapper of rung `rung` (0..) hands out.
  void AddModel(int rung, int number, const SparseModel& model) const;

  // Takes a line of its output, as SfmOptions::on_line.
  void Hear(std::string_view line);
  // One line per call but of help, among those that were heard: the command and its arguments.
  std::vector<std::string> Calls() const;

 private:
  std::string dir_;
  mutable std::mutex mutex_;
  std::vector<std::string> calls_;
};

// A model of the copies `width`x`height`/00000<i>.png for i in photos, with focal length 50 px,
// translation (i, 0, 0), and `points` points seen by all of them at (10, 20) px.
SparseModel CopiesModel(const std::string& folder, int width, int height,
                        const std::vector<int>& photos, int points);

// Points some 90 units in front of those cameras.
std::array<double, 3> FakeWorldPoint(int i);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_FAKE_COLMAP_H_
