#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/description_defaults.h"
#include "fabric/draft.h"
#include "fabric/presets.h"

namespace weft::fabric {
namespace {

using ::testing::HasSubstr;

const char* const kPlain = R"(name: "plain"
weave {
  matrix { rows: "X." rows: ".X" }
  ends_per_cm: 20
  picks_per_cm: 20
  warp_yarn: "y"
  weft_yarn: "y"
}
yarns {
  name: "y"
  material: "m"
  yarn_radius_mm: 0.2
}
materials {
  name: "m"
  c_r { r: 0.1 g: 0.1 b: 0.1 }
  c_tt { r: 0.5 g: 0.5 b: 0.5 }
}
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

v1::FabricDescription parse(const std::string& text, const std::string& name = "f.textproto") {
  return parse_description(text, name, std::filesystem::path());
}

std::string refusal(const std::string& text, const std::string& name = "f.textproto") {
  try {
    (void)parse(text, name);
  } catch (const core::Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Description, IsCanonicalOnceLoaded) {
  const v1::FabricDescription once = parse(kPlain);
  check_description(once);
  EXPECT_EQ(once.yarns(0).plies(), 1U);
  EXPECT_EQ(once.yarns(0).fibres_per_ply(), 40U);
  EXPECT_NEAR(once.yarns(0).fibre_radius_mm(), 0.2 * std::sqrt(0.5 / 40), 1e-12);
  EXPECT_EQ(once.precompute().quality(), v1::QUALITY_PAPER);
  EXPECT_EQ(once.precompute().paths_per_cell(), 4096U);
  EXPECT_FALSE(once.precompute().has_target_standard_error());
  std::string text;
  ASSERT_TRUE(google::protobuf::TextFormat::PrintToString(once, &text));
  EXPECT_EQ(parse(text).SerializeAsString(), once.SerializeAsString());
}

TEST(Description, JsonAndTextGiveTheSame) {
  v1::FabricDescription message;
  ASSERT_TRUE(google::protobuf::TextFormat::ParseFromString(kPlain, &message));
  std::string json;
  ASSERT_TRUE(google::protobuf::util::MessageToJsonString(message, &json).ok());
  EXPECT_EQ(parse(json, "f.json").SerializeAsString(), parse(kPlain).SerializeAsString());
}

struct Broken {
  const char* from;
  const char* to;
  const char* message;
};

TEST(Description, EveryMistakeIsListedWithItsLineAndColumn) {
  const std::vector<Broken> table{
      {"name: \"plain\"", "name: \"Plain!\"",
       "f.textproto:1:1: \"Plain!\" is no name; use small letters, digits, _ and -, at most 64"},
      {"name: \"plain\"", "",
       "f.textproto:1:1: name is missing; give one of small letters, digits, _ and -"},
      {"ends_per_cm: 20", "ends_per_cm: nan",
       "f.textproto:4:3: ends_per_cm is nan; a number from 0.1 to 1000 is needed"},
      {"ends_per_cm: 20", "ends_per_cm: inf",
       "f.textproto:4:3: ends_per_cm is inf; a number from 0.1 to 1000 is needed"},
      {"ends_per_cm: 20", "ends_per_cm: -20",
       "f.textproto:4:3: ends_per_cm is -20; a number from 0.1 to 1000 is needed"},
      {"  ends_per_cm: 20\n", "",
       "f.textproto:2:1: ends_per_cm is missing; a number from 0.1 to 1000 is needed"},
      {"picks_per_cm", "piks_per_cm",
       "f.textproto:2:1: picks_per_cm is missing; a number from 0.1 to 1000 is needed\n"
       "f.textproto:5:3: \"piks_per_cm\" is no field of Weave; did you mean \"picks_per_cm\"?"},
      {"warp_yarn: \"y\"", "warp_yarn: \"coton1\"",
       "f.textproto:6:3: there is no yarn \"coton1\"; did you mean \"cotton1\"?"},
      {"material: \"m\"", "material: \"silq\"",
       "f.textproto:11:3: there is no material \"silq\"; did you mean \"silk\"?"},
      {"material: \"m\"", "material: \"m\" preset: \"rayon9\"",
       "f.textproto:11:17: there is no yarn preset \"rayon9\"; did you mean \"rayon1\"?"},
      {"\".X\"", "\".Y\"",
       "f.textproto:3:23: character 2 of the row is \"Y\"; use X or 1 where the warp is on top, . "
       "or 0 elsewhere"},
      {"\".X\"", "\".X.\"",
       "f.textproto:3:23: this row has 3 ends, the first has 2; all rows need the same length"},
      {"yarn_radius_mm: 0.2", "yarn_radius_mm: 0.2 ply_aspect: 1.5",
       "f.textproto:12:23: ply_aspect is 1.5; a number from 0.05 to 1 is needed"},
      {"yarn_radius_mm: 0.2", "yarn_radius_mm: 0.2 migration { r_min: 0.9 r_max: 0.5 }",
       "f.textproto:12:35: r_min 0.9 is above r_max 0.5; exchange them"},
      {"r: 0.5", "r: 1.5", "f.textproto:17:10: r is 1.5; a number from 0 to 1 is needed"},
      {"materials {", "yarns { name: \"y\" preset: \"silk1\" }\nmaterials {",
       "f.textproto:14:9: the name \"y\" is taken by yarns[0]; give another"},
      {"name: \"plain\"", "name: \"plain\" precompute { sh_order: 6 visibility_resolution: 100 }",
       "f.textproto:1:28: sh_order is 6; a number from 0 to 5 is needed\n"
       "f.textproto:1:40: visibility_resolution is 100; a multiple of 16 is needed, such as 64 or "
       "128"},
      {"name: \"plain\"", "name: \"plain\" precompute { target_standard_error: 0 }",
       "f.textproto:1:28: target_standard_error is 0; a number above 0 up to 1 is needed"},
      {"name: \"plain\"", "name: \"plain\" precompute { target_standard_error: nan }",
       "f.textproto:1:28: target_standard_error is nan; a number above 0 up to 1 is needed"},
      {"name: \"plain\"",
       "name: \"plain\" precompute { target_standard_error: 1e-4 paths_per_cell: 1048577 }",
       "f.textproto:1:56: paths_per_cell is 1048577; with a target_standard_error at most 1048576 "
       "are possible"},
      {"name: \"plain\"", "name: \"plain\" precompute { quality: BEST }",
       "f.textproto:1:37: \"BEST\" is no value of quality; use QUALITY_PREVIEW, QUALITY_PAPER, "
       "QUALITY_BEST"},
      {"name: \"plain\"", "name: \"plain\" exemplar { fibre_share: 2 }",
       "f.textproto:1:26: fibre_share is 2; a number above 0 up to 1 is needed"},
      {"name: \"plain\"", "name: plain", "f.textproto:1:7: Expected string, got: plain"},
      {"matrix { rows: \"X.\" rows: \".X\" }", "wif_file: \"nowhere.wif\"",
       "f.textproto:3:3: cannot read nowhere.wif: no such file"},
      {"matrix { rows: \"X.\" rows: \".X\" }", "wif_text: \"[WIF]\\n\"",
       "f.textproto:3:3: the draft:1: [THREADING] is missing; a draft needs one line per end, "
       "such as 1=1"},
  };
  for (const Broken& broken : table) {
    EXPECT_EQ(refusal(replaced(kPlain, broken.from, broken.to)), broken.message);
  }
  EXPECT_THAT(refusal(""), HasSubstr("the description has no structure; give a weave"));
}

TEST(Description, MistakesInJsonAreNamedByTheirField) {
  const std::string json = R"({"name": "plain", "weave": {"matrix": {"rows": ["X.", ".X"]},
      "endsPerCm": 20, "picks_per_cm": 20, "warp_yarn": "silk1", "weft_yarn": "silk1"}})";
  EXPECT_EQ(refusal(json, "f.json"), "accepted");
  for (const Broken& broken : std::vector<Broken>{
           {"\"endsPerCm\": 20", "\"endsPerCm\": \"NaN\"",
            "f.json: weave.ends_per_cm: ends_per_cm is nan; a number from 0.1 to 1000 is needed"},
           {"\".X\"", "\".Z\"",
            "f.json: weave.matrix.rows[1]: character 2 of the row is \"Z\"; use X or 1 where the "
            "warp is on top, . or 0 elsewhere"},
           {"\"name\"", "\"nam\": 1, \"name\"",
            "f.json: nam: \"nam\" is no field of FabricDescription; did you mean \"name\"?"},
           {"\"warp_yarn\": \"silk1\"", "\"warp_yarn\": 7",
            "f.json: weave.warp_yarn: \"7\" does not fit; a text in quotes is needed\n"
            "f.json: weave: end 1 of colour 1 has no yarn; set weave.warp_yarn or a colour_yarns "
            "entry"},
           {"\"name\": \"plain\"", "\"name\": \"plain\", \"seed\": -1",
            "f.json: seed: \"-1\" does not fit; a whole number from 0 on is needed"}}) {
    EXPECT_EQ(refusal(replaced(json, broken.from, broken.to), "f.json"), broken.message);
  }
  EXPECT_THAT(refusal("{\"name\": \n oops}", "f.json"), HasSubstr("f.json:2:2: syntax error"));
  EXPECT_EQ(refusal("[]", "f.json"), "f.json: a description is an object in braces, { }");
  EXPECT_THAT(refusal(std::string(100000, '['), "f.json"), HasSubstr("nested deeper than 32"));
  EXPECT_NE(refusal(std::string(100000, '{')), "accepted");
}

TEST(Description, ATileOverTheLimitIsRefusedBeforeAnyWork) {
  try {
    (void)parse(std::string(kPlain) + "exemplar { repeats_x: 9000 repeats_y: 9000 }");
    FAIL() << "was not refused";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
    EXPECT_THAT(error.what(), HasSubstr("f.textproto:2:1: the tile would have"));
    EXPECT_THAT(error.what(), HasSubstr("the limit is 2048 MiB"));
  }
}

TEST(Description, UnusedYarnsAndMaterialsAreNoPartOfTheCloth) {
  const v1::FabricDescription plain = parse(kPlain);
  const v1::FabricDescription more =
      parse(std::string(kPlain) + "yarns { name: \"spare\" preset: \"rayon2\" }");
  EXPECT_EQ(more.SerializeAsString(), plain.SerializeAsString());
}

TEST(Description, GeometryIsTheSameHoweverTheDraftIsWritten) {
  const std::string twice =
      replaced(kPlain, "rows: \"X.\" rows: \".X\"", "rows: \"1010\" rows: \"0101\" end_colours: 9");
  const v1::FabricDescription a = geometry_part(parse(kPlain));
  const v1::FabricDescription b = geometry_part(parse(twice));
  EXPECT_EQ(a.SerializeAsString(), b.SerializeAsString());
  EXPECT_EQ(draft_of(a.weave()), draft_of(parse(kPlain).weave()));
  const std::string recoloured = replaced(kPlain, "r: 0.5", "r: 0.9");
  EXPECT_EQ(geometry_part(parse(recoloured)).SerializeAsString(), a.SerializeAsString());
}

TEST(Description, PresetsAreFilledInAndScaled) {
  const v1::Yarn preset = *yarn_preset("cotton1");
  const v1::FabricDescription whole =
      parse(replaced(kPlain, "yarn_radius_mm: 0.2", "preset: \"cotton1\" hairs { per_mm: 0 }"));
  EXPECT_EQ(whole.yarns(0).yarn_radius_mm(), preset.yarn_radius_mm());
  EXPECT_EQ(whole.yarns(0).material(), "m");
  EXPECT_EQ(whole.yarns(0).hairs().per_mm(), 0);
  EXPECT_EQ(whole.yarns(0).preset(), "");
  const v1::FabricDescription scaled =
      parse(replaced(kPlain, "yarn_radius_mm: 0.2", "preset: \"cotton1\" yarn_radius_mm: 0.2"));
  const double factor = 0.2 / preset.yarn_radius_mm();
  EXPECT_NEAR(scaled.yarns(0).fibre_radius_mm(), preset.fibre_radius_mm() * factor, 1e-12);
  EXPECT_NEAR(scaled.yarns(0).ply_twist_per_cm(), preset.ply_twist_per_cm() / factor, 1e-12);
}

TEST(Description, EveryPresetMakesACloth) {
  EXPECT_EQ(embedded_names("yarn").size(), 9U);
  EXPECT_EQ(embedded_names("material").size(), 4U);
  for (const std::string& name : embedded_names("yarn")) {
    std::string text = replaced(kPlain, "warp_yarn: \"y\"", "warp_yarn: \"" + name + "\"");
    text = replaced(text, "ends_per_cm: 20", "ends_per_cm: 12");
    EXPECT_EQ(refusal(replaced(text, "picks_per_cm: 20", "picks_per_cm: 12")), "accepted") << name;
  }
  for (const std::string& name : embedded_names("material")) {
    EXPECT_EQ(refusal(replaced(kPlain, "material: \"m\"", "material: \"" + name + "\"")),
              "accepted");
  }
}

TEST(Description, ExamplesAreOfTheSizesOfTable1) {
  struct Size {
    const char* name;
    double segments;
  };
  for (const Size& size :
       {Size{"fleece", 580660}, Size{"gabardine", 120121}, Size{"silk_plain", 112294},
        Size{"satin_4_1", 318882}, Size{"satin_2_3", 244420}, Size{"satin_1_4", 290149},
        Size{"shot_silk_a", 75550}, Size{"shot_silk_b", 56518}}) {
    const std::string path = std::string(WEFT_SOURCE_DIR) + "/examples/" + size.name + ".textproto";
    const TileEstimate estimate = estimate_tile(load_description(path));
    EXPECT_GE(estimate.fibres, 1200U) << size.name;
    EXPECT_LE(estimate.fibres, 31100U) << size.name;
    EXPECT_NEAR(static_cast<double>(estimate.segments) / size.segments, 1, 0.2) << size.name;
    const v1::FabricDescription preview = load_description(path, v1::QUALITY_PREVIEW);
    EXPECT_LE(estimate_tile(preview).segments, kPreviewSegments * 11 / 10) << size.name;
    EXPECT_EQ(preview.precompute().visibility_resolution(), 128U);
    EXPECT_EQ(preview.precompute().paths_per_cell(), 2048U);
  }
}

}  // namespace
}  // namespace weft::fabric
