#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "render/image.h"
#include "render/png.h"

namespace weft::render {
namespace {

class ImageTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("weft_image_") +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

Image gradient() {
  Image image(7, 5);
  for (std::uint32_t y = 0; y < 5; ++y) {
    for (std::uint32_t x = 0; x < 7; ++x) {
      image.at(x, y) = {static_cast<float>(x) * 0.125f, static_cast<float>(y) * 0.25f, 3.0f};
    }
  }
  image.at(3, 2) = {0.1234567f, 1e5f, 1e-6f};
  image.attributes["weft.integrator"] = "path";
  image.attributes["weft.scene"] = "{\"a\": 1}\nsecond line";
  return image;
}

core::Code code_of_reading(const std::filesystem::path& path) {
  try {
    static_cast<void>(read_exr(path));
  } catch (const core::Error& error) {
    return error.code();
  }
  ADD_FAILURE() << path << " was read";
  return core::Code::kInternal;
}

TEST_F(ImageTest, Exr_OfFloatsComesBackExactlyWithItsAttributes) {
  const Image written = gradient();
  write_exr(file("a.exr"), written, ExrPixels::kFloat);
  const Image back = read_exr(file("a.exr"));
  EXPECT_EQ(back.width, written.width);
  EXPECT_EQ(back.height, written.height);
  EXPECT_EQ(back.pixels, written.pixels);
  EXPECT_EQ(back.attributes.at("weft.integrator"), "path");
  EXPECT_EQ(back.attributes.at("weft.scene"), "{\"a\": 1}\nsecond line");
}

TEST_F(ImageTest, Exr_OfHalvesKeepsElevenBitsAndClampsWhatIsTooLarge) {
  const Image written = gradient();
  write_exr(file("a.exr"), written);
  const Image back = read_exr(file("a.exr"));
  EXPECT_EQ(back.at(6, 4), written.at(6, 4));
  EXPECT_NEAR(back.at(3, 2).x, 0.1234567f, 0.1234567f * 0x1p-11f);
  EXPECT_EQ(back.at(3, 2).y, 65504.0f);
}

TEST_F(ImageTest, Exr_GivesTheSameBytesForTheSamePicture) {
  write_exr(file("a.exr"), gradient());
  write_exr(file("b.exr"), gradient());
  EXPECT_EQ(core::read_file(file("a.exr")), core::read_file(file("b.exr")));
}

TEST_F(ImageTest, Exr_ThatIsCutShortOrNoPictureIsRefused) {
  write_exr(file("a.exr"), gradient());
  const std::string whole = core::read_file(file("a.exr"));
  core::write_file_atomically(file("short.exr"), whole.substr(0, whole.size() - 40));
  core::write_file_atomically(file("head.exr"), whole.substr(0, 60));
  core::write_file_atomically(file("text.exr"), "no picture at all");
  core::write_file_atomically(file("empty.exr"), "");
  for (const char* name : {"short.exr", "head.exr", "text.exr", "empty.exr"}) {
    EXPECT_EQ(code_of_reading(file(name)), core::Code::kDataLoss) << name;
  }
  EXPECT_EQ(code_of_reading(file("absent.exr")), core::Code::kNotFound);
}

TEST_F(ImageTest, Png_IsWrittenWholeAndBeginsWithItsSignature) {
  const Image image = gradient();
  write_png(file("a.png"), image.width, image.height, tone_mapped(image));
  const std::string bytes = core::read_file(file("a.png"));
  EXPECT_EQ(bytes.substr(1, 3), "PNG");
  EXPECT_EQ(bytes.substr(bytes.size() - 8, 4), "IEND");
}

TEST(ToneMapping, KeepsBlackAndMiddleTonesAndNeverPassesWhite) {
  Image image(5, 1);
  image.at(0, 0) = glm::vec3(0);
  image.at(1, 0) = glm::vec3(0.2158605f);  // linear value of sRGB 128 / 255
  image.at(2, 0) = glm::vec3(1000);
  image.at(3, 0) = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  image.at(4, 0) = glm::vec3(-1);
  const std::vector<std::uint8_t> rgb = tone_mapped(image);
  EXPECT_EQ(rgb[0], 0);
  EXPECT_EQ(rgb[3], 128);
  EXPECT_EQ(rgb[6], 255);
  EXPECT_EQ(rgb[9], 0);
  EXPECT_EQ(rgb[12], 0);
}

TEST(ToneMapping, AStopDoublesTheLinearValue) {
  Image image(1, 1);
  image.at(0, 0) = glm::vec3(0.1f);
  Image twice(1, 1);
  twice.at(0, 0) = glm::vec3(0.2f);
  EXPECT_EQ(tone_mapped(image, 1), tone_mapped(twice, 0));
}

TEST(ToneMapping, AutomaticExposureBringsTheLitMeanToMiddleGrey) {
  Image image(4, 1);
  image.at(0, 0) = glm::vec3(0.01f);
  image.at(1, 0) = glm::vec3(0.03f);
  const float stops = automatic_exposure(image);
  EXPECT_NEAR(0.02f * std::exp2(stops), 0.25f, 1e-5f);
  EXPECT_EQ(automatic_exposure(Image(2, 2)), 0);
}

}  // namespace
}  // namespace weft::render
