#include "engine/render/renderer.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/core/aligned.h"
#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/render/binning.h"
#include "engine/render/constants.h"
#include "engine/render/projection.h"
#include "engine/render/rasterize.h"

namespace litags {
namespace {
constexpr size_t kBlocksPerTask = 32;  // 512 Gaussians: long enough to hide the hand-out

bool HasVjp(int channels) {
  return channels == kColorOnly || channels == kWithoutNoise || channels == kNumChannels;
}

}  // namespace

struct Renderer::Impl {
  KernelCamera camera;
  int width = 0, height = 0;
  // Of the last Forward: its degree and threads are those used, it keeps no channel that it does
  // not have, and nothing cancels it any more.
  RenderSettings settings;
  bool has_vjp = false;

  ProjectedSplats projected;
  TileLists lists;
  BinScratch bin_scratch;
  std::vector<uint64_t> reach;  // see TileJob; tiles one after the other
  AlignedFloats pair_grads;     // [pairs][GradStride]
  std::vector<TileScratch> tile_scratch;
  std::vector<int64_t> tile_evaluations;
  ViewStats stats;
  std::vector<PoseVector> block_pose_grads;  // if wanted
  PoseVector pose_grad = {};
  Counters counters;

  TileJob JobOf(size_t tile) {
    TileJob job;
    const TileRect& part = lists.part;
    job.x0 = (part.x + static_cast<int>(tile % part.width)) * kTileSize;
    job.y0 = (part.y + static_cast<int>(tile / part.width)) * kTileSize;
    job.width = width;
    job.height = height;
    job.channels = settings.num_channels;
    job.kept_channels = settings.kept_channels;
    const uint32_t begin = lists.tile_begin[tile];
    job.count = lists.tile_begin[tile + 1] - begin;
    job.gaussians = lists.gaussians.data() + begin;
    job.records = projected.records.data();
    job.background = settings.background.data();
    // The part of tiles before this one is no longer than this.
    job.reach = reach.data() + (begin / kChunk + tile) * kMaxTileBlocks;
    return job;
  }

  // Bins and composites the part, and adds to the counters.
  void DrawPart(const TileRect& part, const CancelToken* cancel, float* image, float* alpha);
  void BackwardBlock(const Splats& splats, size_t block, BlockGradSink sink);
};

Renderer::Renderer() : impl_(std::make_unique<Impl>()) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

const ViewStats& Renderer::stats() const { return impl_->stats; }
const PoseVector& Renderer::pose_grad() const { return impl_->pose_grad; }
Renderer::Counters Renderer::counters() const { return impl_->counters; }

void Renderer::Forward(const Splats& splats, const Camera& camera, const RenderSettings& settings,
                       Planes* image, Planes* alpha) {
  const int C = settings.num_channels;
  LITAGS_CHECK(C == kDepthOnly || C == kColorAndNoise || HasVjp(C));
  Impl& s = *impl_;
  const PixelRect& crop = settings.crop;
  s.camera = KernelCamera(camera);
  if (!crop.empty()) s.camera.CropTo(crop);
  s.width = crop.empty() ? camera.width : crop.width;
  s.height = crop.empty() ? camera.height : crop.height;
  s.settings = settings;
  s.settings.sh_degree = std::clamp(settings.sh_degree, 0, kMaxShDegree);
  s.settings.threads = settings.threads > 0 ? settings.threads : DefaultThreadCount();
  s.settings.kept_channels &= (1u << C) - 1;
  s.settings.cancel = nullptr;
  const int kept = std::popcount(s.settings.kept_channels);
  s.has_vjp = HasVjp(C) && settings.max_pairs == 0 && kept == C;

  s.projected.Resize(splats.size(), settings.num_channels);
  s.stats.visible.resize(splats.size());
  const size_t blocks = splats.num_blocks();
  ParallelFor(s.settings.threads, (blocks + kBlocksPerTask - 1) / kBlocksPerTask,
              [&](size_t task, int) {
                const size_t end = std::min(blocks, (task + 1) * kBlocksPerTask);
                for (size_t b = task * kBlocksPerTask; b < end; ++b) {
                  ProjectBlock(splats, b, s.camera, s.settings, &s.projected);
                }
                const size_t last = std::min(splats.size(), end * kSplatBlock);
                for (size_t i = task * kBlocksPerTask * kSplatBlock; i < last; ++i) {
                  s.stats.visible[i] = !s.projected.boxes[i].empty();
                }
              });

  image->Reshape(kept, s.height, s.width);
  alpha->Reshape(1, s.height, s.width);
  s.counters = {};
  const std::vector<TileRect> parts =
      settings.max_pairs == 0 ? std::vector<TileRect>{AllTiles(s.width, s.height)}
                              : PartsOf(s.projected, s.width, s.height, settings.max_pairs);
  for (const TileRect& part : parts) {
    if (settings.cancel && settings.cancel->IsCancelled()) return;
    s.DrawPart(part, settings.cancel, image->data.data(), alpha->data.data());
  }
}

void Renderer::Impl::DrawPart(const TileRect& part, const CancelToken* cancel, float* image,
                              float* alpha) {
  Bin(projected, part, settings.threads, &lists, &bin_scratch);
  const size_t tiles = part.size();
  reach.resize((lists.num_pairs() / kChunk + tiles) * kMaxTileBlocks);
  tile_evaluations.resize(tiles);
  ParallelFor(settings.threads, tiles, [&](size_t tile, int) {
    if (cancel && cancel->IsCancelled()) return;
    tile_evaluations[tile] = RasterizeTile(JobOf(tile), image, alpha);
  });

  const auto pairs = static_cast<int64_t>(lists.num_pairs());
  counters.visible += static_cast<int64_t>(lists.num_visible);
  counters.tile_pairs += pairs;
  counters.most_pairs = std::max(counters.most_pairs, pairs);
  for (const int64_t n : tile_evaluations) counters.evaluations += n;
}

void Renderer::Impl::BackwardBlock(const Splats& splats, size_t block, BlockGradSink sink) {
  if (projected.visible[block] == 0) return;
  const int stride = GradStride(settings.num_channels);
  const size_t begin = block * kSplatBlock, end = std::min(splats.size(), begin + kSplatBlock);
  alignas(64) float sums[GradStride(kNumChannels) * kSplatBlock] = {};
  uint32_t visible = 0;
  for (size_t i = begin; i < end; ++i) {
    if (projected.boxes[i].empty()) continue;
    const int lane = static_cast<int>(i - begin);
    visible |= 1u << lane;
    float total[GradStride(kNumChannels)] = {};
    for (uint32_t slot = lists.slot_begin[i]; slot < lists.slot_begin[i + 1]; ++slot) {
      const float* pair = pair_grads.data() + size_t{slot} * stride;
      for (int f = 0; f < stride; ++f) total[f] += pair[f];
    }
    for (int f = 0; f < stride; ++f) sums[f * kSplatBlock + lane] = total[f];
  }
  alignas(64) float grads[Splats::kBlockFloats] = {};
  alignas(64) float mean2d[2 * kSplatBlock];
  ProjectBlockVjp(splats, block, camera, settings, sums, visible, grads, mean2d,
                  settings.pose_grad ? &block_pose_grads[block] : nullptr);
  for (size_t i = begin; i < end; ++i) {
    const int lane = static_cast<int>(i - begin);
    const float x = mean2d[lane], y = mean2d[kSplatBlock + lane];
    stats.grad_means2d[i] = std::sqrt(x * x + y * y);
  }
  sink(block, grads, visible);
}

void Renderer::Backward(const Splats& splats, const Planes& v_image, const Planes& v_alpha,
                        BlockGradSink sink) {
  Impl& s = *impl_;
  LITAGS_CHECK(splats.size() == s.projected.boxes.size());
  LITAGS_CHECK(s.has_vjp);
  LITAGS_CHECK(v_image.channels == s.settings.num_channels && v_image.width == s.width &&
               v_image.height == s.height);
  const int stride = GradStride(s.settings.num_channels);
  ResizeScratch(s.lists.num_pairs() * stride, &s.pair_grads);
  s.tile_scratch.resize(s.settings.threads);
  const size_t tiles = s.lists.tile_begin.size() - 1;
  ParallelFor(s.settings.threads, tiles, [&](size_t tile, int thread) {
    TileGradients gradients;
    gradients.v_image = v_image.data.data();
    gradients.v_alpha = v_alpha.empty() ? nullptr : v_alpha.data.data();
    gradients.slots = s.lists.slots.data() + s.lists.tile_begin[tile];
    gradients.pairs = s.pair_grads.data();
    gradients.detached_channels = s.settings.detached_channels;
    RasterizeTileVjp(s.JobOf(tile), gradients, &s.tile_scratch[thread]);
  });

  s.stats.grad_means2d.resize(splats.size());
  const size_t blocks = splats.num_blocks();
  s.block_pose_grads.assign(s.settings.pose_grad ? blocks : 0, PoseVector());
  ParallelFor(s.settings.threads, (blocks + kBlocksPerTask - 1) / kBlocksPerTask,
              [&](size_t task, int) {
                const size_t end = std::min(blocks, (task + 1) * kBlocksPerTask);
                for (size_t b = task * kBlocksPerTask; b < end; ++b)
                  s.BackwardBlock(splats, b, sink);
              });
  s.pose_grad = {};
  for (const PoseVector& part : s.block_pose_grads) {
    for (int k = 0; k < 6; ++k) s.pose_grad[k] += part[k];
  }
}

}  // namespace litags
