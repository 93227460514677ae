#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/draft.h"
#include "fabric/wif_import.h"

namespace weft::fabric {
namespace {

using ::testing::HasSubstr;

const char* const kStripes =
    "[WIF]\nVersion=1.1\nSource Program=Loom \"1\"\n[CONTENTS]\nTHREADING=1\n"
    "[TEXT]\nTitle=Stripes\n[WEAVING]\nRising Shed=1\n"
    "[WARP]\nThreads=4\nUnits=cm\nSpacing=0.05\nThickness=0.03\n"
    "[WEFT]\nThreads=2\nUnits=cm\nSpacing=0.04\nThickness=0.09\n"
    "[COLOR PALETTE]\nRange=0,255\n[COLOR TABLE]\n1=255,0,0\n2=0,0,255\n3=0,255,0\n"
    "[WARP COLORS]\n1=1\n2=1\n3=2\n4=2\n[WEFT COLORS]\n1=3\n2=3\n"
    "[THREADING]\n1=1\n2=2\n3=1\n4=2\n[LIFTPLAN]\n1=1\n2=2\n";

ImportOptions options() {
  ImportOptions result;
  result.name = "stripes";
  result.draft_name = "stripes.wif";
  result.wif_reference = "stripes.wif";
  return result;
}

v1::FabricDescription load(const ImportedDraft& imported) {
  return parse_description(imported.text, "stripes.textproto", std::filesystem::path());
}

TEST(WifImport, MakesADescriptionThatLoads) {
  const ImportedDraft imported = import_draft(read_wif(kStripes, "stripes.wif"), options());
  const v1::FabricDescription fabric = load(imported);
  EXPECT_EQ(fabric.name(), "stripes");
  EXPECT_EQ(fabric.comment(), "Stripes");
  EXPECT_EQ(fabric.weave().ends_per_cm(), 20);
  EXPECT_EQ(fabric.weave().picks_per_cm(), 25);
  const Draft draft = draft_of(fabric.weave());
  EXPECT_EQ(draft.end_yarns, (std::vector<std::string>{"warp_1", "warp_1", "warp_2", "warp_2"}));
  EXPECT_EQ(draft.pick_yarns, (std::vector<std::string>{"weft", "weft"}));
  EXPECT_TRUE(draft.warp_up(0, 0));
  EXPECT_FALSE(draft.warp_up(0, 1));
  EXPECT_EQ(fabric.materials_size(), 3);
  EXPECT_GT(fabric.materials(0).c_tt().r(), 0.9);
  EXPECT_LT(fabric.materials(0).c_tt().g(), 0.02);
  EXPECT_EQ(fabric.yarns(0).yarn_radius_mm(), 0.15);
  EXPECT_EQ(imported.notes,
            (std::vector<std::string>{"[WEAVING] does not state its Shafts; 2 are used",
                                      "weft: yarns of 0.9 mm have no room at this sett; 0.336 mm "
                                      "are taken"}));
  EXPECT_GT(build_tile(fabric).strands.size(), 0U);
}

TEST(WifImport, ACropKeepsOnlyItsColours) {
  ImportOptions cropped = options();
  cropped.crop.set_first_end(3);
  cropped.crop.set_ends(2);
  cropped.fibre_share = 0.5;
  const v1::FabricDescription fabric =
      load(import_draft(read_wif(kStripes, "stripes.wif"), cropped));
  EXPECT_EQ(draft_of(fabric.weave()).end_yarns, (std::vector<std::string>{"warp", "warp"}));
  EXPECT_EQ(fabric.materials_size(), 2);
  EXPECT_EQ(fabric.exemplar().fibre_share(), 0.5);
  cropped.crop.set_ends(3);
  EXPECT_THROW((void)import_draft(read_wif(kStripes, "stripes.wif"), cropped), core::Error);
}

TEST(WifImport, NamesComeFromFiles) {
  EXPECT_EQ(name_from_file("Overshot_Honeysuckle"), "overshot_honeysuckle");
  EXPECT_EQ(name_from_file("Gr\xc3\xbc\xc3\x9f e!"), "gr_____e_");
  EXPECT_EQ(name_from_file("_x"), "draft_x");
  EXPECT_EQ(name_from_file(""), "draft");
}

TEST(WifImport, RealDraftsMakeDescriptionsThatLoad) {
  const char* data = std::getenv("WEFT_SHARED_DATA");
  if (data == nullptr || !std::filesystem::exists(std::string(data) + "/wif")) {
    GTEST_SKIP() << "WEFT_SHARED_DATA does not name a folder with wif/";
  }
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(data) + "/wif")) {
    if (entry.path().extension() != ".wif") {
      continue;
    }
    ImportOptions from_file = options();
    from_file.name = name_from_file(entry.path().stem().string());
    from_file.draft_name = entry.path().string();
    from_file.wif_reference = entry.path().string();
    const WifDraft draft = read_wif(core::read_file(entry.path()), entry.path().string());
    const v1::FabricDescription fabric = load(import_draft(draft, from_file));
    EXPECT_EQ(fabric.name(), from_file.name);
    EXPECT_GT(estimate_tile(fabric).segments, 0U) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 10);
}

}  // namespace
}  // namespace weft::fabric
