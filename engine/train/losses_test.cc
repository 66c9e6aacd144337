#include "engine/train/losses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/simd_test_util.h"
#include "engine/train/loss_test_util.h"

namespace litags {
namespace {

// ---- The oracle: every loss as one plain double expression over all samples. ----

using Image = std::vector<double>;  // [C, H, W]

struct Size {
  int c, h, w;
  int samples() const { return c * h * w; }
};

double OracleL1(const Image& x, const Image& y, const Image& weights, Size size) {
  double sum = 0;
  for (int i = 0; i < size.samples(); ++i) {
    sum += std::abs(x[i] - y[i]) * (weights.empty() ? 1 : weights[i % (size.h * size.w)]);
  }
  return sum / size.samples();
}

double OracleMse(const Image& x, const Image& y, Size size) {
  double sum = 0;
  for (int i = 0; i < size.samples(); ++i) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return sum / size.samples();
}

double OracleTv(const Image& x, TvNorm norm, Size size) {
  double horizontal = 0, vertical = 0;
  const auto cost = [&](double d) { return norm == TvNorm::kSquared ? d * d : std::abs(d); };
  for (int r = 0; r < size.c * size.h; ++r) {
    for (int i = 0; i < size.w; ++i) {
      const double v = x[r * size.w + i];
      if (i + 1 < size.w) horizontal += cost(x[r * size.w + i + 1] - v);
      if (r % size.h + 1 < size.h) vertical += cost(x[(r + 1) * size.w + i] - v);
    }
  }
  return (size.w > 1 ? horizontal / (size.c * size.h * (size.w - 1)) : 0) +
         (size.h > 1 ? vertical / (size.c * (size.h - 1) * size.w) : 0);
}

// SSIM by its definition: a dense 11x11 window at every pixel, five moments.
double OracleSsim(const Image& x, const Image& y, Size size) {
  double window[11][11], total = 0;
  for (int i = 0; i < 11; ++i) {
    for (int j = 0; j < 11; ++j) {
      window[i][j] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / (2 * 1.5 * 1.5));
      total += window[i][j];
    }
  }
  double sum = 0;
  for (int c = 0; c < size.c; ++c) {
    for (int py = 0; py < size.h; ++py) {
      for (int px = 0; px < size.w; ++px) {
        double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
        for (int i = std::max(0, py - 5); i <= std::min(size.h - 1, py + 5); ++i) {
          for (int j = std::max(0, px - 5); j <= std::min(size.w - 1, px + 5); ++j) {
            const double w = window[i - py + 5][j - px + 5] / total;
            const double a = x[(c * size.h + i) * size.w + j], b = y[(c * size.h + i) * size.w + j];
            mx += w * a, my += w * b, xx += w * a * a, yy += w * b * b, xy += w * a * b;
          }
        }
        const double c1 = 1e-4, c2 = 9e-4;
        sum += (2 * mx * my + c1) * (2 * (xy - mx * my) + c2) /
               ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
      }
    }
  }
  return sum / size.samples();
}

Image Doubles(const Planes& planes) { return Image(planes.data.begin(), planes.data.end()); }

// ---- One description of every loss, run over sizes, threads and finite differences. ----

struct Problem {
  Planes x, y, l, w;
};

struct Case {
  const char* name;
  // Adds gradients to v_x and v_l (the second factor or side, where there is one).
  std::function<double(const Problem&, double, PlanesSpan, PlanesSpan, LossWorkspace&)> loss;
  std::function<double(const Image& x, const Image& l, const Problem&, Size)> oracle;
  bool has_second = false;
};

Image Times(const Image& a, const Image& b) {
  Image product(a.size());
  for (size_t i = 0; i < a.size(); ++i) product[i] = a[i] * b[i];
  return product;
}

std::vector<Case> Cases() {
  std::vector<Case> cases;
  cases.push_back({"L1",
                   [](const Problem& p, double k, PlanesSpan v, PlanesSpan, LossWorkspace& ws) {
                     return L1Loss(p.x, p.y, k, v, ws);
                   },
                   [](const Image& x, const Image&, const Problem& p, Size s) {
                     return OracleL1(x, Doubles(p.y), {}, s);
                   }});
  cases.push_back({"weighted L1",
                   [](const Problem& p, double k, PlanesSpan v, PlanesSpan, LossWorkspace& ws) {
                     return L1Loss(p.x, p.y, k, v, ws, p.w);
                   },
                   [](const Image& x, const Image&, const Problem& p, Size s) {
                     return OracleL1(x, Doubles(p.y), Doubles(p.w), s);
                   }});
  cases.push_back(
      {"MSE of x and l",
       [](const Problem& p, double k, PlanesSpan v, PlanesSpan v_l, LossWorkspace& ws) {
         return MseLoss(p.x, p.l, k, v, v_l, ws);
       },
       [](const Image& x, const Image& l, const Problem&, Size s) { return OracleMse(x, l, s); },
       true});
  for (const TvNorm norm : {TvNorm::kSquared, TvNorm::kAbsolute}) {
    cases.push_back({norm == TvNorm::kSquared ? "squared TV" : "absolute TV",
                     [norm](const Problem& p, double k, PlanesSpan v, PlanesSpan,
                            LossWorkspace& ws) { return TvLoss(p.x, norm, k, v, ws); },
                     [norm](const Image& x, const Image&, const Problem&, Size s) {
                       return OracleTv(x, norm, s);
                     }});
  }
  cases.push_back({"SSIM",
                   [](const Problem& p, double k, PlanesSpan v, PlanesSpan, LossWorkspace& ws) {
                     return SsimLoss(p.x, p.y, k, v, ws);
                   },
                   [](const Image& x, const Image&, const Problem& p, Size s) {
                     return 1 - OracleSsim(x, Doubles(p.y), s);
                   }});
  cases.push_back({"reconstruction",
                   [](const Problem& p, double k, PlanesSpan v, PlanesSpan, LossWorkspace& ws) {
                     return ReconstructionLoss(p.x, p.y, k, v, ws);
                   },
                   [](const Image& x, const Image&, const Problem& p, Size s) {
                     return 0.8 * OracleL1(x, Doubles(p.y), {}, s) +
                            0.2 * (1 - OracleSsim(x, Doubles(p.y), s));
                   }});
  cases.push_back({"weighted product reconstruction",
                   [](const Problem& p, double k, PlanesSpan v, PlanesSpan v_l, LossWorkspace& ws) {
                     return ProductReconstructionLoss(p.x, p.l, p.y, k, v, v_l, ws, {}, p.w);
                   },
                   [](const Image& x, const Image& l, const Problem& p, Size s) {
                     const Image product = Times(x, l);
                     return 0.8 * OracleL1(product, Doubles(p.y), Doubles(p.w), s) +
                            0.2 * (1 - OracleSsim(product, Doubles(p.y), s));
                   },
                   true});
  return cases;
}

Problem MakeProblem(Size size) {
  return {RandomPlanes(size.c, size.h, size.w, 1), RandomPlanes(size.c, size.h, size.w, 2),
          RandomPlanes(size.c, size.h, size.w, 3), RandomPlanes(1, size.h, size.w, 4)};
}

// One pixel, one row, one column, smaller than the window, vectors +-1, tiles +-1, several tiles.
const Size kSizes[] = {{1, 1, 1},  {3, 1, 19}, {2, 17, 1},  {3, 4, 7},   {1, 9, 15},
                       {3, 8, 16}, {1, 7, 17}, {1, 12, 63}, {2, 66, 65}, {1, 130, 70}};

TEST(Losses, ValuesMatchTheScalarOracleAtOddSizes) {
  LossWorkspace ws(2);
  for (const Size size : kSizes) {
    const Problem p = MakeProblem(size);
    for (const Case& test : Cases()) {
      const double value = test.loss(p, 0.7, {}, {}, ws);
      const double expected = 0.7 * test.oracle(Doubles(p.x), Doubles(p.l), p, size);
      // Single precision per pixel, double sums.
      EXPECT_NEAR(value, expected, 2e-6 * std::max(1.0, expected))
          << test.name << " " << size.c << "x" << size.h << "x" << size.w;
    }
  }
}

TEST(Losses, GradientsMatchFiniteDifferencesOfTheOracle) {
  LossWorkspace ws(2);
  constexpr double kWeight = 0.7, kStep = 1e-5;
  for (const Size size : {Size{1, 1, 1}, Size{2, 5, 3}, Size{1, 13, 18}, Size{1, 3, 66}}) {
    const Problem p = MakeProblem(size);
    for (const Case& test : Cases()) {
      Planes v_x(size.c, size.h, size.w), v_l(size.c, size.h, size.w);
      test.loss(p, kWeight, v_x, v_l, ws);
      for (const bool second : {false, true}) {
        if (second && !test.has_second) continue;
        std::vector<double> expected(size.samples());
        for (int i = 0; i < size.samples(); ++i) {
          Image x = Doubles(p.x), l = Doubles(p.l);
          double& variable = second ? l[i] : x[i];
          const double centre = variable;
          variable = centre + kStep;
          const double above = test.oracle(x, l, p, size);
          variable = centre - kStep;
          expected[i] = kWeight * (above - test.oracle(x, l, p, size)) / (2 * kStep);
        }
        ExpectGradientsNear((second ? v_l : v_x).data, expected, 1e-4, test.name);
      }
    }
  }
}

TEST(Losses, ResultsAreTheSameBytesForAnyNumberOfThreads) {
  const Size size = {3, 131, 203};
  const Problem p = MakeProblem(size);
  for (const Case& test : Cases()) {
    LossWorkspace one(1);
    Planes v_x(size.c, size.h, size.w), v_l(size.c, size.h, size.w);
    const double value = test.loss(p, 0.3, v_x, v_l, one);
    for (const int threads : {2, 5}) {
      LossWorkspace many(threads);
      Planes w_x(size.c, size.h, size.w), w_l(size.c, size.h, size.w);
      EXPECT_EQ(test.loss(p, 0.3, w_x, w_l, many), value) << test.name;
      EXPECT_EQ(w_x.data, v_x.data) << test.name;
      EXPECT_EQ(w_l.data, v_l.data) << test.name;
    }
  }
}

TEST(Losses, EverySimdTargetGivesTheSameResult) {
  const Size size = {2, 67, 81};
  const Problem p = MakeProblem(size);
  LossWorkspace ws(1);
  for (const Case& test : Cases()) {
    Planes best_x(size.c, size.h, size.w), best_l = best_x;
    const double best = test.loss(p, 1, best_x, best_l, ws);
    ForEachTarget([&] {
      Planes v_x(size.c, size.h, size.w), v_l = v_x;
      const double value = test.loss(p, 1, v_x, v_l, ws);
      // Rounding and the order of sums only.
      EXPECT_NEAR(value, best, 2e-6) << test.name;
      ExpectGradientsNear(v_x.data, Doubles(best_x), 2e-5, test.name);
      ExpectGradientsNear(v_l.data, Doubles(best_l), 2e-5, test.name);
    });
  }
}

TEST(Losses, AskingForNoGradientChangesNoValue) {
  const Size size = {3, 70, 90};
  const Problem p = MakeProblem(size);
  LossWorkspace ws(2);
  for (const Case& test : Cases()) {
    Planes v_x(size.c, size.h, size.w), v_l(size.c, size.h, size.w);
    EXPECT_EQ(test.loss(p, 1, {}, {}, ws), test.loss(p, 1, v_x, v_l, ws)) << test.name;
  }
}

TEST(Losses, GradientsAreAddedToWhatIsThere) {
  const Size size = {3, 20, 30};
  const Problem p = MakeProblem(size);
  LossWorkspace ws(2);
  for (const Case& test : Cases()) {
    Planes once(size.c, size.h, size.w), once_l = once, twice = once, twice_l = once;
    test.loss(p, 1, once, once_l, ws);
    test.loss(p, 1, twice, twice_l, ws);
    test.loss(p, 1, twice, twice_l, ws);
    for (size_t i = 0; i < once.data.size(); ++i) {
      ASSERT_FLOAT_EQ(twice.data[i], 2 * once.data[i]) << test.name;
      ASSERT_FLOAT_EQ(twice_l.data[i], 2 * once_l.data[i]) << test.name;
    }
  }
}

TEST(Losses, AWorkspaceServesChangingSizes) {
  LossWorkspace shared(2);
  for (const Size size : {Size{3, 80, 100}, Size{1, 10, 200}, Size{3, 80, 99}, Size{3, 80, 100}}) {
    const Problem p = MakeProblem(size);
    LossWorkspace fresh(2);
    Planes v(size.c, size.h, size.w), expected = v;
    const double value = ReconstructionLoss(p.x, p.y, 1, v, shared);
    EXPECT_EQ(value, ReconstructionLoss(p.x, p.y, 1, expected, fresh));
    EXPECT_EQ(v.data, expected.data);
  }
}

TEST(Losses, ChannelsOfALargerRenderAreUsedInPlace) {
  const Planes render = RandomPlanes(11, 21, 33, 5), target = RandomPlanes(3, 21, 33, 6);
  Planes illumination(3, 21, 33), v_render(11, 21, 33), v(3, 21, 33);
  std::copy_n(render.plane(8), illumination.data.size(), illumination.data.begin());
  LossWorkspace ws(1);
  const double value =
      ReconstructionLoss(PlanesView(render, 8, 3), target, 1, PlanesSpan(v_render, 8, 3), ws);
  EXPECT_EQ(value, ReconstructionLoss(illumination, target, 1, v, ws));
  EXPECT_TRUE(std::equal(v.data.begin(), v.data.end(), v_render.plane(8)));
  EXPECT_TRUE(std::all_of(v_render.plane(0), v_render.plane(8), [](float g) { return g == 0; }));
}

TEST(Losses, AnImageAgainstItselfCostsNothing) {
  const Planes x = RandomPlanes(3, 40, 50, 7);
  Planes v(3, 40, 50);
  LossWorkspace ws(1);
  EXPECT_EQ(L1Loss(x, x, 1, v, ws), 0);
  EXPECT_TRUE(std::all_of(v.data.begin(), v.data.end(), [](float g) { return g == 0; }));
  EXPECT_NEAR(ReconstructionLoss(x, x, 1, v, ws), 0, 1e-7);
  // The derivative of SSIM vanishes at its maximum, up to rounding in single precision.
  for (const float g : v.data) ASSERT_NEAR(g * x.data.size(), 0, 1e-3);
}

TEST(UnpackImage, GivesEveryChannelItsPlane) {
  Photo photo(37, 29);
  const CounterRng rng(3, 0);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = int(rng.Below(i, 65536)) - 32768;
  LossWorkspace ws(2);
  Planes planes;
  UnpackImage(photo, ws, &planes);
  ASSERT_EQ(planes.channels, 3);
  EXPECT_EQ(planes.data, ToPlanes(photo).data);
}

TEST(UnpackPlane, MapsBytesToTheUnitInterval) {
  PlaneU8 bytes(3, 1);
  bytes.data = {0, 51, 255};
  LossWorkspace ws(1);
  Planes plane;
  UnpackPlane(bytes, 1.0f / 255.0f, ws, &plane);
  EXPECT_EQ(plane.width, 3);
  EXPECT_FLOAT_EQ(plane.data[0], 0.0f);
  EXPECT_FLOAT_EQ(plane.data[1], 0.2f);
  EXPECT_FLOAT_EQ(plane.data[2], 1.0f);
}

}  // namespace
}  // namespace litags
