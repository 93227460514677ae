#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/description.h"
#include "fabric/draft.h"

namespace weft::fabric {
namespace {

v1::Weave weave_of(const std::vector<std::string>& rows) {
  v1::Weave weave;
  for (const std::string& row : rows) {
    weave.mutable_matrix()->add_rows(row);
  }
  weave.set_warp_yarn("warp");
  weave.set_weft_yarn("weft");
  return weave;
}

TEST(Draft, OfAMatrixIsReducedToItsMinimalRepeat) {
  const Draft draft = draft_of(weave_of({"X.X.X.", ".X.X.X", "1010X.", ".X.X01"}));
  EXPECT_EQ(draft.ends, 2U);
  EXPECT_EQ(draft.picks, 2U);
  EXPECT_TRUE(draft.warp_up(0, 0));
  EXPECT_FALSE(draft.warp_up(0, 1));
  EXPECT_FALSE(draft.warp_up(1, 0));
  EXPECT_TRUE(draft.warp_up(1, 1));
}

TEST(Draft, ThatDoesNotDivideStaysWhole) {
  const Draft draft = draft_of(weave_of({"X.X", ".X.", "X.X"}));
  EXPECT_EQ(draft.ends, 3U);
  EXPECT_EQ(draft.picks, 3U);
}

TEST(Draft, YarnsArePartOfTheRepeatAndUnusedColoursAreNot) {
  v1::Weave weave = weave_of({"X.", ".X"});
  for (const std::uint32_t colour : {7U, 7U, 8U}) {
    weave.mutable_matrix()->add_end_colours(colour);
  }
  EXPECT_EQ(draft_of(weave).ends, 2U);
  v1::ColourYarn& entry = *weave.add_colour_yarns();
  entry.set_colour(8);
  entry.set_warp_yarn("stripe");
  const Draft draft = draft_of(weave);
  EXPECT_EQ(draft.ends, 6U);
  EXPECT_EQ(draft.picks, 2U);
  EXPECT_EQ(draft.end_yarns,
            (std::vector<std::string>{"warp", "warp", "stripe", "warp", "warp", "stripe"}));
}

TEST(Draft, IsCroppedBeforeItIsReduced) {
  v1::Weave weave = weave_of({"XXX.X.", "XXX.X.", "....X.", "...X.X"});
  weave.mutable_crop()->set_first_end(3);
  weave.mutable_crop()->set_ends(4);
  weave.mutable_crop()->set_first_pick(3);
  const Draft draft = draft_of(weave);
  EXPECT_EQ(draft.ends, 4U);
  EXPECT_EQ(draft.picks, 2U);
  EXPECT_TRUE(draft.warp_up(0, 2));
  EXPECT_TRUE(draft.warp_up(1, 1));
}

TEST(Draft, BrokenMatricesAreRefusedWithAReason) {
  const auto message = [](const v1::Weave& weave) -> std::string {
    try {
      (void)draft_of(weave);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(message(v1::Weave()), "the weave has no draft; give a matrix or a wif_file");
  EXPECT_EQ(message(weave_of({"X.", "X"})),
            "row 2 of the matrix has 1 ends, the first has 2; all rows need the same length");
  EXPECT_EQ(message(weave_of({"X?"})),
            "row 1 of the matrix has the character '?'; use X or 1 where the warp is on top, . or "
            "0 elsewhere");
  v1::Weave weave = weave_of({"X.", ".X"});
  weave.mutable_crop()->set_first_end(2);
  weave.mutable_crop()->set_ends(2);
  EXPECT_EQ(message(weave), "the crop wants 2 ends from end 2 on, the draft has only 1 there");
}

TEST(Description, TheTinyExampleLoadsWithItsDefaultsExpanded) {
  const v1::FabricDescription tiny =
      load_description(std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto");
  EXPECT_EQ(tiny.name(), "tiny");
  EXPECT_EQ(tiny.exemplar().repeats_x(), 2U);
  EXPECT_EQ(tiny.exemplar().fibre_share(), 1);
  EXPECT_EQ(tiny.precompute().sg_count(), 48U);
  EXPECT_TRUE(tiny.yarns(0).migration().has_r_min());
}

TEST(Description, ColoursAreNoPartOfTheGeometry) {
  v1::FabricDescription tiny =
      load_description(std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto");
  const std::string before = geometry_part(tiny).SerializeAsString();
  tiny.mutable_materials(0)->mutable_c_r()->set_r(0.5);
  tiny.mutable_precompute()->set_sh_order(1);
  EXPECT_EQ(geometry_part(tiny).SerializeAsString(), before);
  tiny.mutable_yarns(0)->set_plies(3);
  EXPECT_NE(geometry_part(tiny).SerializeAsString(), before);
}

}  // namespace
}  // namespace weft::fabric
