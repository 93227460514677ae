#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/compare.h"

namespace weft::render {
namespace {

TEST(Compare, APictureDoesNotDifferFromItself) {
  Image image(3, 2);
  image.at(1, 1) = {1, 2, 3};
  const Comparison same = compare(image, image);
  EXPECT_EQ(same.rmse_all, 0);
  EXPECT_EQ(same.relative_mean_error[2], 0.0);
  EXPECT_EQ(same.pixels, 6U);
  EXPECT_EQ(natural_scale(image, image), 1);
}

TEST(Compare, GivesRmseAndRelativeErrorOfTheMeanPerChannel) {
  Image image(2, 1);
  Image reference(2, 1);
  image.at(0, 0) = {3, 1, 1};
  image.at(1, 0) = {1, 1, 0};
  reference.at(0, 0) = {1, 2, 0};
  reference.at(1, 0) = {1, 0, 0};
  const Comparison result = compare(image, reference);
  EXPECT_DOUBLE_EQ(result.rmse.x, std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(result.rmse.y, 1);
  EXPECT_DOUBLE_EQ(result.rmse_all, std::sqrt(7.0 / 6));
  EXPECT_DOUBLE_EQ(*result.relative_mean_error[0], 1);
  EXPECT_DOUBLE_EQ(*result.relative_mean_error[1], 0);
  EXPECT_FALSE(result.relative_mean_error[2].has_value());
}

TEST(Compare, LeavesOutAndCountsPixelsThatAreNotFinite) {
  Image image(2, 1);
  Image reference(2, 1);
  image.at(0, 0) = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  image.at(1, 0) = glm::vec3(2);
  reference.at(1, 0) = glm::vec3(1);
  const Comparison result = compare(image, reference);
  EXPECT_EQ(result.non_finite_pixels, 1U);
  EXPECT_DOUBLE_EQ(result.rmse_all, 1);
  EXPECT_THROW(static_cast<void>(compare(Image(2, 1), Image(1, 2))), core::Error);
}

TEST(Compare, TheDifferencePictureIsRedWhereItIsBrighterAndBlueWhereItIsDarker) {
  Image image(3, 1);
  Image reference(3, 1);
  image.at(0, 0) = glm::vec3(1);
  reference.at(1, 0) = glm::vec3(1);
  const auto rgb = difference_picture(image, reference, 1);
  EXPECT_EQ(rgb[0], 255);
  EXPECT_EQ(rgb[2], 0);
  EXPECT_EQ(rgb[3], 0);
  EXPECT_EQ(rgb[5], 255);
  EXPECT_EQ(rgb[6] + rgb[7] + rgb[8], 0);
}

}  // namespace
}  // namespace weft::render
