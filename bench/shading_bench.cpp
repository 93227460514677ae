#include <array>
#include <cmath>
#include <cstddef>

#include <benchmark/benchmark.h>

#include "core/random.h"
#include "shading/bcsdf_sh.h"
#include "shading/fibre_bcsdf.h"
#include "shading/gamma.h"
#include "shading/sh_rotation.h"

// What one call of the innermost appearance functions costs, over directions as paths meet them.

namespace {

using weft::shading::FibreBcsdf;

constexpr std::size_t kCount = 4096;

weft::shading::FibreMaterial material() {
  weft::shading::FibreMaterial m;
  m.c_r = {0.185f, 0.047f, 0.069f};
  m.c_tt = {0.999f, 0.330f, 0.354f};
  m.beta_r = 0.0374f;
  m.beta_tt = 0.1745f;
  m.gamma_tt = 0.411f;
  return m;
}

struct Workload {
  FibreBcsdf bcsdf{material()};
  std::array<glm::vec3, kCount> omega_o;
  std::array<glm::vec3, kCount> omega_i;  // sampled
  std::array<glm::vec3, kCount> u;

  Workload() {
    weft::core::Random random(1, 0);
    for (std::size_t k = 0; k < kCount; ++k) {
      const float z = 2 * random.uniform() - 1;
      const float phi = weft::shading::kTwoPi * random.uniform();
      const float s = std::sqrt(1 - z * z);
      omega_o[k] = {s * std::cos(phi), s * std::sin(phi), z};
      for (int i = 0; i < 3; ++i) {
        u[k][i] = random.uniform();
      }
      omega_i[k] = bcsdf.sample(omega_o[k], u[k].x, u[k].y, u[k].z).omega_i;
    }
  }
};

const Workload& workload() {
  static const Workload made;
  return made;
}

template <class F>
void run(benchmark::State& state, const F& call) {
  const Workload& w = workload();
  std::size_t k = 0;
  for (auto iteration : state) {
    benchmark::DoNotOptimize(call(w, k));
    k = (k + 1) % kCount;
  }
}

void evaluate(benchmark::State& state) {
  run(state, [](const Workload& w, std::size_t k) {
    return w.bcsdf.evaluate(w.omega_i[k], w.omega_o[k]);
  });
}

void sample(benchmark::State& state) {
  run(state, [](const Workload& w, std::size_t k) {
    return w.bcsdf.sample(w.omega_o[k], w.u[k].x, w.u[k].y, w.u[k].z);
  });
}

void scatter(benchmark::State& state) {
  run(state, [](const Workload& w, std::size_t k) {
    const glm::vec3 throughput(1);
    return w.bcsdf.scatter(w.omega_o[k], w.bcsdf.odds(w.omega_o[k], throughput), throughput,
                           w.u[k]);
  });
}

void pdf(benchmark::State& state) {
  run(state,
      [](const Workload& w, std::size_t k) { return w.bcsdf.pdf(w.omega_i[k], w.omega_o[k]); });
}

// Argument: kGammaClosed, kGammaGl12, kGammaHybrid.
void gamma(benchmark::State& state) {
  const int method = static_cast<int>(state.range(0));
  run(state, [&](const Workload& w, std::size_t k) {
    return weft::shading::gamma_integral(w.bcsdf.lobes(), {w.omega_i[k], 150}, w.omega_o[k],
                                         method);
  });
}

void rotate_harmonics(benchmark::State& state) {
  const weft::shading::ShVector v = weft::shading::sh_evaluate({0.48f, 0.6f, 0.64f});
  run(state, [&](const Workload& w, std::size_t k) {
    const auto frame = weft::shading::fibre_frame(w.omega_i[k], w.omega_o[k]);
    return weft::shading::sh_rotate(weft::shading::sh_rotation(frame), v);
  });
}

void build_bcsdf(benchmark::State& state) {
  for (auto iteration : state) {
    benchmark::DoNotOptimize(FibreBcsdf(material()));
  }
}

void build_sh_table(benchmark::State& state) {
  for (auto iteration : state) {
    benchmark::DoNotOptimize(weft::shading::bcsdf_sh_table(material(), 5));
  }
}

}  // namespace

BENCHMARK(evaluate);
BENCHMARK(sample);
BENCHMARK(scatter);
BENCHMARK(pdf);
BENCHMARK(gamma)->Arg(0)->Arg(1)->Arg(2);
BENCHMARK(rotate_harmonics);
BENCHMARK(build_bcsdf)->Unit(benchmark::kMillisecond);
BENCHMARK(build_sh_table)->Unit(benchmark::kMillisecond);
BENCHMARK_MAIN();
