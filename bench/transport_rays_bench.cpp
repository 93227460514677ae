// Rays against fibres: ours (wide and portable) and Embree's in the same run, in turns.
//   cmake --build build --target bench_transport && build/bin/bench_transport
//   --benchmark_filter=rays

#include <algorithm>
#include <array>
#include <cstdint>
#include <ctime>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "core/random.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "tests/ray_agreement.h"
#include "transport/embree_scene.h"
#include "transport/float_mode.h"
#include "transport/scene.h"
#include "transport/wide.h"

namespace {

using namespace weft;  // NOLINT(google-build-using-namespace)

constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr std::size_t kBatch = 20000;
constexpr double kMostDifferent = 1e-4;  // of the rays, all of them matters of rounding

enum Fabric : std::int64_t { kSatin, kSilk, kFleece };
constexpr std::array<const char*, 3> kFiles{"satin_4_1", "silk_plain", "fleece"};

struct Cloth {
  explicit Cloth(std::int64_t which)
      : tile(fabric::build_tile(
            fabric::load_description(std::string(WEFT_SOURCE_DIR "/examples/") +
                                         kFiles.at(static_cast<std::size_t>(which)) + ".textproto",
                                     v1::QUALITY_PREVIEW))) {}

  fabric::Tile tile;
  transport::EmbreeScene embree{tile};
  transport::Scene ours{tile};
  transport::Scene portable{tile, false};
};

const Cloth& cloth(std::int64_t which) {
  static std::array<std::unique_ptr<Cloth>, 3> built;
  auto& one = built.at(static_cast<std::size_t>(which));
  if (!one) {
    one = std::make_unique<Cloth>(which);
  }
  return *one;
}

double thread_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// What random walks trace: in the order of the walks from neighbouring segments, or shuffled.
std::vector<test::TracedRay> some_rays(const Cloth& on, bool shuffled) {
  std::vector<std::uint32_t> segments;
  const std::uint32_t count = on.tile.segment_count();
  for (std::uint64_t cell = 0; segments.size() < kBatch / 64; ++cell) {
    const std::uint32_t first = core::Random(1, 0, cell).below(count);
    for (std::uint32_t i = 0; i < 16; ++i) {
      segments.push_back((first + i) % count);
    }
  }
  std::vector<test::TracedRay> rays = test::rays_of_walks(on.ours, segments, 64, 8 * kBatch);
  if (shuffled) {
    for (std::size_t i = rays.size(); i > 1; --i) {
      const auto other = core::Random(2, 0, i).below(static_cast<std::uint32_t>(i));
      std::swap(rays[i - 1], rays[other]);
    }
  }
  return rays;
}

// Seconds that a tracer takes for the rays [first, last); what it answers goes into `blocked`.
template <bool kClosest, class Tracer>
double trace(const Tracer& tracer, const std::vector<test::TracedRay>& rays, std::size_t first,
             std::size_t last, std::uint64_t& blocked) {
  const double start = thread_cpu_s();
  for (std::size_t i = first; i < last; ++i) {
    const test::TracedRay& ray = rays[i];
    if constexpr (kClosest) {
      blocked += tracer.closest(ray.origin_mm, ray.direction, kFar, ray.ignored) ? 1 : 0;
    } else {
      blocked += tracer.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored) ? 1 : 0;
    }
  }
  return thread_cpu_s() - start;
}

// Whether ours answers as Embree does, up to rounding, and portable as wide does, to the bit.
template <bool kClosest>
bool agree(const Cloth& on, const std::vector<test::TracedRay>& rays) {
  test::Disagreement sum;
  std::uint64_t different = 0;
  for (const test::TracedRay& ray : rays) {
    if constexpr (kClosest) {
      const auto hit = on.ours.closest(ray.origin_mm, ray.direction, kFar, ray.ignored);
      const auto same = on.portable.closest(ray.origin_mm, ray.direction, kFar, ray.ignored);
      different += hit.has_value() != same.has_value() ||
                           (hit && (hit->t_mm != same->t_mm || hit->segment != same->segment))
                       ? 1
                       : 0;
      test::compare(on.ours, ray, hit,
                    on.embree.closest(ray.origin_mm, ray.direction, kFar, ray.ignored), sum);
    } else {
      const bool blocked = on.ours.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored);
      different +=
          blocked != on.portable.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored) ? 1 : 0;
      sum.fibres +=
          blocked != on.embree.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored) ? 1 : 0;
    }
  }
  return different == 0 && sum.unexplained == 0 &&
         static_cast<double>(sum.fibres) <= kMostDifferent * static_cast<double>(rays.size());
}

template <bool kClosest>
void rays(benchmark::State& state) {
  const transport::FlushDenormals flush;  // as bakers do
  const Cloth& on = cloth(state.range(0));
  const std::vector<test::TracedRay> all = some_rays(on, state.range(1) != 0);
  if (!agree<kClosest>(on, all)) {
    state.SkipWithError("the tracers do not agree");
    return;
  }
  std::array<double, 3> seconds{};
  std::array<std::uint64_t, 3> blocked{};
  std::size_t first = 0;
  std::size_t traced = 0;
  for (auto unused : state) {
    const std::size_t last = std::min(first + kBatch, all.size());
    seconds[0] += trace<kClosest>(on.embree, all, first, last, blocked[0]);
    seconds[1] += trace<kClosest>(on.ours, all, first, last, blocked[1]);
    seconds[2] += trace<kClosest>(on.portable, all, first, last, blocked[2]);
    traced += last - first;
    first = last == all.size() ? 0 : last;
  }
  const auto rate = [&](std::size_t i) { return static_cast<double>(traced) / seconds.at(i); };
  state.counters["embree_rays/s"] = rate(0);
  state.counters["ours_rays/s"] = rate(1);
  state.counters["ratio"] = rate(1) / rate(0);
  state.counters["portable_ratio"] = rate(2) / rate(0);
  state.counters["hit_share"] = static_cast<double>(blocked[1]) / static_cast<double>(traced);
}
const auto kWorkloads = [](benchmark::internal::Benchmark* b) {
  b->ArgNames({"fabric", "shuffled"})->ArgsProduct({{kSatin, kSilk, kFleece}, {0, 1}});
};
BENCHMARK(rays<true>)->Name("rays_closest")->Apply(kWorkloads)->Unit(benchmark::kMillisecond);
BENCHMARK(rays<false>)->Name("rays_occluded")->Apply(kWorkloads)->Unit(benchmark::kMillisecond);

// Seconds of all threads: Embree builds with several.
double process_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void scene_build(benchmark::State& state) {
  const fabric::Tile& tile = cloth(state.range(0)).tile;
  std::array<double, 2> seconds{};
  std::array<std::size_t, 2> bytes{};
  for (auto unused : state) {
    const double start = process_cpu_s();
    bytes[0] = transport::EmbreeScene(tile).size_bytes();
    const double middle = process_cpu_s();
    bytes[1] = transport::Scene(tile).size_bytes();
    seconds[0] += middle - start;
    seconds[1] += process_cpu_s() - middle;
  }
  const auto segments = static_cast<double>(tile.segment_count());
  state.counters["segments"] = segments;
  state.counters["embree_bytes"] = static_cast<double>(bytes[0]) / segments;
  state.counters["our_bytes"] = static_cast<double>(bytes[1]) / segments;
  state.counters["embree_ms"] = 1e3 * seconds[0] / static_cast<double>(state.iterations());
  state.counters["our_ms"] = 1e3 * seconds[1] / static_cast<double>(state.iterations());
  state.counters["ratio"] = seconds[0] / seconds[1];
}
BENCHMARK(scene_build)
    ->ArgName("fabric")
    ->DenseRange(kSatin, kFleece)
    ->Unit(benchmark::kMillisecond);

}  // namespace
