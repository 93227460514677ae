#include "tests/render_gpu_parity.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/kernels/kernels.h"

// Every function of shading/ on the device against the same text in C++.

namespace weft::render::gpu {
namespace {

using shading::ParityInput;
using shading::ParityOutput;
using testing::IsEmpty;

constexpr std::size_t kInputs = 10'000;

std::vector<ParityOutput> parity_on_host(int which, const std::vector<ParityInput>& inputs) {
  std::vector<ParityOutput> outputs;
  outputs.reserve(inputs.size());
  for (const ParityInput& input : inputs) {
    outputs.push_back(shading::parity_case(which, input));
  }
  return outputs;
}

// Both languages round each operation within a few units of the last place, so that smooth terms
// agree to 1e-5 of `term_size` or more, below which a result is what cancellation left of its
// terms; the tail is bounded by a count. Returns how many numbers vary with the input.
int expect_same_numbers(const std::vector<ParityOutput>& device,
                        const std::vector<ParityOutput>& host, double term_size) {
  constexpr double kUsual = 1e-5;
  constexpr double kOutlier = 1e-4;
  constexpr double kWorst = 1e-3;
  int varying = 0;
  for (int k = 0; k < shading::kParityNumbers; ++k) {
    std::vector<double> errors;
    bool varies = false;
    for (std::size_t i = 0; i < host.size(); ++i) {
      const double a = device[i].v[k];
      const double b = host[i].v[k];
      if (!std::isfinite(a) || !std::isfinite(b)) {
        ADD_FAILURE() << "number " << k << " of input " << i << ": " << a << " and " << b;
        return varying;
      }
      varies = varies || host[i].v[k] < host[0].v[k] || host[i].v[k] > host[0].v[k];
      errors.push_back(std::abs(a - b) / (std::abs(b) + term_size));
    }
    varying += varies ? 1 : 0;
    std::sort(errors.begin(), errors.end());
    EXPECT_LE(errors[errors.size() * 99 / 100], kUsual) << "number " << k;
    EXPECT_LE(errors.end() - std::upper_bound(errors.begin(), errors.end(), kOutlier), 5)
        << "number " << k;
    EXPECT_LE(errors.back(), kWorst) << "number " << k;
  }
  return varying;
}

struct Case {
  int which;
  double term_size;
  int numbers;  // that vary with the input
};
void PrintTo(const Case& test, std::ostream* out) { *out << "group " << test.which; }

class Parity : public testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(Shading, Parity,
                         testing::Values(Case{0, 1e-3, 13}, Case{1, 1e-2, 11}, Case{2, 1e-3, 16},
                                         Case{3, 1e-3, 15}, Case{4, 1e-3, 9}, Case{5, 1e-3, 7},
                                         Case{6, 1e-3, 16}, Case{7, 1e-2, 36}, Case{8, 1e-2, 38},
                                         Case{9, 1e-2, 36}, Case{10, 1e-2, 38}, Case{11, 1e-3, 4}),
                         [](const auto& about) {
                           return fmt::format("Group{}", about.param.which);
                         });

TEST_P(Parity, OfDeviceAndHost) {
  const auto device = Device::open("", {.validation = Validation::kOn});
  const std::vector<ParityInput> inputs = ParityInputs().make(kInputs);
  const Case& test = GetParam();
  const std::vector<ParityOutput> host = parity_on_host(test.which, inputs);
  const std::vector<ParityOutput> of_device =
      parity_on_device(*device, test_kernels::parity, test.which, inputs);
  EXPECT_EQ(expect_same_numbers(of_device, host, test.term_size), test.numbers);
  EXPECT_THAT(device->complaints(), IsEmpty());
}

TEST(ParityOfIntegers, IsExactAwayFromTheBordersOfPixels) {
  constexpr int kMaps = 6;
  constexpr float kBorder = 1e-3F;  // pixels
  const auto device = Device::open();
  const std::vector<ParityInput> inputs = ParityInputs().make(kInputs);
  const std::vector<ParityOutput> host = parity_on_host(kMaps, inputs);
  const std::vector<ParityOutput> of_device =
      parity_on_device(*device, test_kernels::parity, kMaps, inputs);
  const auto near_border = [](float at) { return std::abs(at - std::round(at)) < kBorder; };
  std::size_t at_border = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    EXPECT_EQ(of_device[i].n[1], host[i].n[1]);
    if (near_border(host[i].v[0]) || near_border(host[i].v[1])) {
      ++at_border;
    } else {
      EXPECT_EQ(of_device[i].n[0], host[i].n[0]) << i;
    }
  }
  EXPECT_LT(at_border, inputs.size() / 2);
}

TEST(ParityOfIntegers, IsExactForRandomWords) {
  constexpr int kRandom = 11;
  const auto device = Device::open();
  const std::vector<ParityInput> inputs = ParityInputs().make(kInputs);
  const std::vector<ParityOutput> host = parity_on_host(kRandom, inputs);
  const std::vector<ParityOutput> of_device =
      parity_on_device(*device, test_kernels::parity, kRandom, inputs);
  EXPECT_EQ(std::memcmp(of_device.data(), host.data(), kInputs * sizeof(ParityOutput)), 0);
  EXPECT_NE(host[0].n[0], host[1].n[0]);
}

// What a software device computes must not depend on how many threads it has, nor on the run.
TEST(ParityOfRuns, IsExact) {
  constexpr int kGamma = 4;
  const std::vector<ParityInput> inputs = ParityInputs().make(kInputs);
  std::vector<std::vector<ParityOutput>> results;
  for (const char* threads : {"", "", "1", "3"}) {
    if (*threads != '\0') {
      ASSERT_EQ(setenv("LP_NUM_THREADS", threads, 1), 0);  // lavapipe reads it when it opens
    }
    const auto device = Device::open();
    results.push_back(parity_on_device(*device, test_kernels::parity, kGamma, inputs));
  }
  ASSERT_EQ(unsetenv("LP_NUM_THREADS"), 0);
  for (const auto& result : results) {
    EXPECT_EQ(std::memcmp(result.data(), results[0].data(), kInputs * sizeof(ParityOutput)), 0);
  }
}

}  // namespace
}  // namespace weft::render::gpu
