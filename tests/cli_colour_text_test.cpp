#include <string>

#include <gtest/gtest.h>

#include "cli/colour_text.h"
#include "core/error.h"

namespace weft::cli {
namespace {

void expect_near(glm::dvec3 found, glm::dvec3 expected, double tolerance) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(found[c], expected[c], tolerance);
  }
}

std::string refusal(const std::string& text) {
  try {
    (void)parse_colour(text);
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument) << text;
    return error.what();
  }
  return "";
}

TEST(CliColourText, Colours_AreReadInEveryForm) {
  expect_near(parse_colour("#7a1f2b"), {0.194618, 0.013702, 0.024158}, 1e-6);
  expect_near(parse_colour("#fff"), {1, 1, 1}, 1e-12);
  expect_near(parse_colour("#F80"), parse_colour("#ff8800"), 1e-12);
  expect_near(parse_colour("linear:0.25,0.5,1"), {0.25, 0.5, 1}, 1e-12);
  expect_near(parse_colour("lab:53.2408,80.0925,67.2032"), {1, 0, 0}, 2e-4);
  expect_near(parse_colour("lab:100,0,0"), {1, 1, 1}, 1e-9);
}

TEST(CliColourText, HexText_IsReadBack) {
  for (const std::string text : {"#000000", "#7a1f2b", "#ffffff", "#010203"}) {
    EXPECT_EQ(hex_text(parse_colour(text)), text);
  }
  EXPECT_EQ(hex_text({-1, 0.5, 2}), "#00bcff");
}

TEST(CliColourText, WhatIsNoColour_IsRefusedWithTheFormsThereAre) {
  for (const std::string text :
       {"", "red", "#12", "#1234567", "#ggg", "#12345g", "linear:1,2", "linear:1,2,3,4",
        "linear:a,b,c", "lab:50,0", "lab:nan,0,0", "7a1f2b", "lab:50;0;0"}) {
    EXPECT_NE(refusal(text).find("is no colour"), std::string::npos) << text;
  }
}

TEST(CliColourText, ColoursOutsideTheGamut_AreRefusedWithANearOne) {
  EXPECT_NE(refusal("linear:1.2,0.5,0.5").find("outside"), std::string::npos);
  const std::string message = refusal("lab:60,90,-80");
  EXPECT_NE(message.find("outside"), std::string::npos);
  EXPECT_NE(message.find("#"), std::string::npos);
  EXPECT_NE(refusal("lab:150,0,0").find("L* goes from 0 to 100"), std::string::npos);
}

}  // namespace
}  // namespace weft::cli
