#include "engine/train/train_state.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstring>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/core/simd_target.h"
#include "engine/io/container.h"

namespace litags {
namespace {

constexpr char kKind[] = "checkpoint";
constexpr int64_t kMaxBytes = int64_t{32} << 30;  // 20 million Gaussians take half of it

std::string_view Bytes(const AlignedFloats& v) {
  return {reinterpret_cast<const char*>(v.data()), v.size() * sizeof(float)};
}

absl::Status Inconsistent(const std::string& what) {
  return MakeError(absl::StatusCode::kDataLoss, "CHECKPOINT_INCONSISTENT", "checkpoint",
                   absl::StrCat("checkpoint: ", what,
                                " does not fit the rest; delete the checkpoint to start again"));
}

absl::Status ReadSplats(const Container& file, const char* name, size_t n, Splats* out) {
  LITAGS_ASSIGN_OR_RETURN(const std::string_view bytes, file.Section(name));
  out->Resize(n);
  if (bytes.size() != out->data().size() * sizeof(float)) return Inconsistent(name);
  std::memcpy(out->data().data(), bytes.data(), bytes.size());
  if (out->FirstNotFinite() < n) return Inconsistent(absl::StrCat("a NaN or infinity in ", name));
  return absl::OkStatus();
}

void AddNets(const char* name, const PdmWeights& weights, ContainerWriter* out) {
  for (size_t k = 0; k < weights.nets.size(); ++k) {
    out->AddArrayView(absl::StrCat(name, k), weights.nets[k]);
  }
}

absl::Status ReadNets(const Container& file, const char* name, int hidden, size_t count,
                      PdmWeights* out) {
  out->hidden = hidden;
  out->nets.resize(count);
  for (size_t k = 0; k < count; ++k) {
    LITAGS_ASSIGN_OR_RETURN(out->nets[k], file.Array<float>(absl::StrCat(name, k)));
    if (out->nets[k].size() != PdmNetLayout(hidden).size) return Inconsistent(name);
  }
  return absl::OkStatus();
}

void AddNanRecoveries(const std::vector<NanRecovery>& nan_recoveries, ContainerWriter* out) {
  for (size_t k = 0; k < nan_recoveries.size(); ++k) {
    const NanRecovery& d = nan_recoveries[k];
    out->AddSection(absl::StrCat("nan_recovery", k),
                    absl::StrCat(d.iteration, d.gaussians ? " gaussians " : " photo ", d.source));
  }
}

absl::Status ReadNanRecoveries(const Container& file, size_t count, std::vector<NanRecovery>* out) {
  out->resize(count);
  for (size_t k = 0; k < count; ++k) {
    LITAGS_ASSIGN_OR_RETURN(const std::string_view text,
                            file.Section(absl::StrCat("nan_recovery", k)));
    const std::vector<std::string> parts =
        absl::StrSplit(absl::string_view(text.data(), text.size()), absl::MaxSplits(' ', 2));
    NanRecovery& d = (*out)[k];
    if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &d.iteration)) {
      return Inconsistent("nan_recovery");
    }
    d.gaussians = parts[1] == "gaussians";
    d.source = parts[2];
  }
  return absl::OkStatus();
}

absl::Status ReadPoses(const Container& file, std::vector<CameraPose>* out) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<double> numbers, file.Array<double>("cameras"));
  constexpr size_t kNumbers = sizeof(CameraPose) / sizeof(double);
  if (numbers.size() % kNumbers != 0) return Inconsistent("cameras");
  if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
    return Inconsistent("a NaN or infinity in cameras");
  }
  out->resize(numbers.size() / kNumbers);
  std::memcpy(static_cast<void*>(out->data()), numbers.data(), numbers.size() * sizeof(double));
  return absl::OkStatus();
}

// "AVX2" and "AVX3": "AVX2, AVX3"; those that are there already once.
std::string WithTarget(const std::string& targets, const std::string& target) {
  std::vector<std::string> all = absl::StrSplit(targets, ", ", absl::SkipEmpty());
  if (std::find(all.begin(), all.end(), target) == all.end()) all.push_back(target);
  return absl::StrJoin(all, ", ");
}

}  // namespace

absl::Status SaveTrainState(const std::string& path, const std::string& fingerprint,
                            const TrainState& state) {
  ContainerWriter out(kKind, kCheckpointVersion);
  const std::vector<int64_t> header = {state.iteration, int64_t(state.splats.params.size()),
                                       state.pdm.hidden, int64_t(state.pdm.nets.size()),
                                       int64_t(state.nan_recoveries.size())};
  out.AddSection("fingerprint", fingerprint);
  out.AddSection("simd target", WithTarget(state.saved_on, SimdTarget()));
  out.AddArrayView("header", header);
  out.AddSectionView("splats", Bytes(state.splats.params.data()));
  out.AddSectionView("splats_moment1", Bytes(state.splats.moment1.data()));
  out.AddSectionView("splats_moment2", Bytes(state.splats.moment2.data()));
  AddNets("pdm", state.pdm, &out);
  AddNets("pdm_moment1_", state.pdm_moment1, &out);
  AddNets("pdm_moment2_", state.pdm_moment2, &out);
  if (!state.poses.empty()) {
    out.AddSectionView("cameras", {reinterpret_cast<const char*>(state.poses.data()),
                                   state.poses.size() * sizeof(CameraPose)});
  }
  out.AddArrayView("density_grad", state.density.grad);
  out.AddArrayView("density_weight", state.density.views);
  AddNanRecoveries(state.nan_recoveries, &out);
  return out.Commit(path);
}

absl::StatusOr<TrainState> LoadTrainState(const std::string& path, const std::string& fingerprint) {
  LITAGS_ASSIGN_OR_RETURN(const Container file, Container::Read(path, kKind, kCheckpointVersion,
                                                                kCheckpointVersion, kMaxBytes));
  LITAGS_ASSIGN_OR_RETURN(const std::string_view found, file.Section("fingerprint"));
  if (found != fingerprint) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "CHECKPOINT_MISMATCH", "checkpoint",
                     absl::StrCat(path,
                                  " was made from other photos or options; use another folder, or "
                                  "delete it to start again"));
  }
  LITAGS_ASSIGN_OR_RETURN(const std::vector<int64_t> header, file.Array<int64_t>("header"));
  if (header.size() != 5 || header[0] < 0 || header[0] > INT_MAX || header[1] < 1 ||
      header[2] < 0 || header[2] > 64 || header[3] < 0 || header[3] > 8 || header[4] < 0 ||
      header[4] > int64_t{kMaxNanRecoveries}) {
    return Inconsistent("header");
  }
  TrainState state;
  state.iteration = static_cast<int>(header[0]);
  if (const auto target = file.Section("simd target"); target.ok()) state.saved_on = *target;
  const auto n = static_cast<size_t>(header[1]);
  LITAGS_ASSIGN_OR_RETURN(state.density.grad, file.Array<float>("density_grad"));
  LITAGS_ASSIGN_OR_RETURN(state.density.views, file.Array<float>("density_weight"));
  if (state.density.grad.size() != n || state.density.views.size() != n)
    return Inconsistent("density");
  LITAGS_RETURN_IF_ERROR(ReadSplats(file, "splats", n, &state.splats.params));
  LITAGS_RETURN_IF_ERROR(ReadSplats(file, "splats_moment1", n, &state.splats.moment1));
  LITAGS_RETURN_IF_ERROR(ReadSplats(file, "splats_moment2", n, &state.splats.moment2));
  const int hidden = static_cast<int>(header[2]);
  const auto nets = static_cast<size_t>(header[3]);
  LITAGS_RETURN_IF_ERROR(ReadNets(file, "pdm", hidden, nets, &state.pdm));
  LITAGS_RETURN_IF_ERROR(ReadNets(file, "pdm_moment1_", hidden, nets, &state.pdm_moment1));
  LITAGS_RETURN_IF_ERROR(ReadNets(file, "pdm_moment2_", hidden, nets, &state.pdm_moment2));
  LITAGS_RETURN_IF_ERROR(
      ReadNanRecoveries(file, static_cast<size_t>(header[4]), &state.nan_recoveries));
  if (file.Section("cameras").ok()) LITAGS_RETURN_IF_ERROR(ReadPoses(file, &state.poses));
  return state;
}

}  // namespace litags
