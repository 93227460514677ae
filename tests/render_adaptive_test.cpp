#include <cmath>

#include <gtest/gtest.h>

#include "render/adaptive.h"
#include "render/draw.h"

namespace weft::render {
namespace {

constexpr double kDimRadiance = 0.5;
constexpr double kBrightRadiance = 2;

// The left half of what the camera sees is dim and without noise; the right half is bright where
// one sample in five finds a light.
class HalfNoisy : public Integrator {
 public:
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override {
    const bool is_noisy = ray.origin_mm.x > 0;
    const bool finds = random.uniform() < 0.2f;
    EyeSample sample;
    sample.on_cloth = true;
    sample.radiance =
        glm::vec3(static_cast<float>(is_noisy ? (finds ? 5 * kBrightRadiance : 0) : kDimRadiance));
    return sample;
  }
};

Camera from_above() {
  Camera::View view;
  view.position_mm = {0, 0, 10};
  view.look_at_mm = {0, 0, 0};
  view.perspective = false;
  view.height = 1;
  return Camera(view, 1.0);
}

DrawSettings settings(double target_error, std::uint64_t seed) {
  DrawSettings settings;
  settings.width = 32;
  settings.height = 32;
  settings.samples_per_pixel = 4096;
  settings.target_error = target_error;
  settings.seed = seed;
  return settings;
}

Drawing drawing_of(const DrawSettings& settings) {
  return draw(
      from_above(), HalfNoisy(), settings, [](double) {}, [] { return false; });
}

// Mean over the pixels of one half, their borders left out, of a channel.
double mean_of(const Image& image, bool right) {
  double sum = 0;
  int count = 0;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (std::uint32_t x = right ? 20 : 0; x < (right ? 32U : 12U); ++x, ++count) {
      sum += static_cast<double>(image.pixels[y * image.width + x].x);
    }
  }
  return sum / count;
}

TEST(Adaptive, PixelsGetTheErrorThatIsAskedForAndNoMoreSamples) {
  const double target = 0.05;
  const Drawing drawing = drawing_of(settings(target, 1));
  const double picture = (kDimRadiance + kBrightRadiance) / 2;
  const double error = target * std::sqrt(kBrightRadiance * picture);
  EXPECT_NEAR(mean_of(drawing.standard_error, true), error, 0.1 * error);
  // One in five: the variance of a sample is 4 times the square of the mean.
  const double needed = 4 * kBrightRadiance * kBrightRadiance / (error * error);
  EXPECT_NEAR(drawing.mean_samples, (needed + kPilotSamples) / 2, 0.1 * needed);
  EXPECT_EQ(mean_of(drawing.standard_error, false), 0);
}

TEST(Adaptive, TheMeanIsNotBiased) {
  constexpr int kSeeds = 40;
  double sum = 0;
  double squared = 0;
  double cloth = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    // So few samples that their own variance would say little about how many are needed.
    const Drawing drawing = drawing_of(settings(0.2, seed));
    const double mean = mean_of(drawing.image, true);
    sum += mean / kSeeds;
    squared += mean * mean / kSeeds;
    cloth += drawing.cloth_mean.x / kSeeds;
  }
  const double error = std::sqrt((squared - sum * sum) / (kSeeds - 1));
  EXPECT_LT(error, 0.02);
  EXPECT_NEAR(sum, kBrightRadiance, 4 * error);
  EXPECT_NEAR(cloth, (kDimRadiance + kBrightRadiance) / 2, 4 * error);
}

TEST(Adaptive, PassesAndThreadsMakeTheSamePicture) {
  DrawSettings wanted = settings(0.1, 3);
  wanted.samples_per_pixel = 100;
  const Drawing whole = drawing_of(wanted);
  wanted.threads = 1;
  GrowingDrawing growing(wanted);
  for (const std::uint32_t count : {1U, 12U, 7U, 80U}) {
    growing.add_samples(
        from_above(), HalfNoisy(), count, [](double) {}, [] { return false; });
  }
  EXPECT_EQ(growing.drawing().image.pixels, whole.image.pixels);
  EXPECT_EQ(growing.drawing().cloth_mean, whole.cloth_mean);
  EXPECT_LT(whole.mean_samples, 100);
}

TEST(Adaptive, WithoutATargetAllPixelsGetAll) {
  DrawSettings wanted = settings(0, 3);
  wanted.samples_per_pixel = 20;
  EXPECT_EQ(drawing_of(wanted).mean_samples, 20);
  wanted.target_error = 0.001;
  // The dim half but for the two columns that have noisy neighbours.
  EXPECT_EQ(drawing_of(wanted).mean_samples, (18 * 20 + 14 * 16) / 32.0);
}

}  // namespace
}  // namespace weft::render
