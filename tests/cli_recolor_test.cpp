#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/local_run.h"
#include "cli/make_colourway.h"
#include "core/exit_code.h"
#include "fabric/description.h"
#include "shading/colour_space.h"
#include "tests/cli_programs.h"

namespace weft::cli {
namespace {

using testing::HasSubstr;

// examples/tiny.textproto with more paths, made once for all tests.
class RecolorTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TestFolder;
    cache_ = new ResultCache(*folder_ / "cache");
    base_ = *folder_ / "tiny.h5";
    make(fabric::load_description(write_description(*folder_, "4096"), v1::QUALITY_PREVIEW), base_);
  }
  static void TearDownTestSuite() {
    delete cache_;
    delete folder_;
  }

  static core::Digest make(const v1::FabricDescription& description, const std::string& output) {
    const LocalRunHooks hooks{[](const std::vector<StageProgress>&) {}, [] { return false; }};
    return run_locally(description, 2, *cache_, output, hooks).content_digest;
  }

  static ColourwaySource source() { return open_colourway_source(base_, {}); }

  static const SwatchResponse& response() {
    static const SwatchResponse made(source().contents.database, 2);
    return made;
  }

  static ColourwayRequest request_of(const ColourwaySource& source,
                                     const std::vector<std::string>& yarns) {
    return {&source, &source, colour_targets(yarns, source.contents.database),
            "tiny",  2,       own_exposure(source.contents, response())};
  }

  static ColourFit fit(const ColourwayRequest& request) {
    return fit_colourway(request, response(),
                         std::vector<glm::dvec3>(request.targets.size(), glm::dvec3(1)));
  }

  static inline TestFolder* folder_ = nullptr;
  static inline ResultCache* cache_ = nullptr;
  static inline std::string base_;
};

TEST_F(RecolorTest, ColoursThatAreAskedFor_AreShown) {
  const ColourwaySource tiny = source();
  const ColourwayRequest request = request_of(tiny, {"warp=#7a1f2b", "weft=lab:40,-10,-15"});
  ASSERT_EQ(request.targets.size(), 2U);
  std::vector<glm::dvec3> correction(2, glm::dvec3(1));
  ColourFit found;
  for (int round = 0; round < 3 && (round == 0 || found.worst_delta_e() > 0.3); ++round) {
    found = fit_colourway(request, response(), correction);
    measure_fit(request, carried_colourway(request, found).database, found, correction);
  }
  // Drawn from what was made, not what the fit expects.
  EXPECT_LT(found.worst_delta_e(), 1);
}

TEST_F(RecolorTest, TheSameRequest_GivesTheSameBytes) {
  const ColourwaySource tiny = source();
  const ColourwayRequest request = request_of(tiny, {"warp=#305030"});
  const auto write = [&](const std::string& name) {
    storage::RecolourableDatabase made = carried_colourway(request, fit(request));
    (void)state_origin(request, made);
    return storage::write_database(made.database, made.recolouring, *folder_ / name);
  };
  EXPECT_EQ(write("one.h5"), write("two.h5"));
}

TEST_F(RecolorTest, TheResponse_IsThatOfPictures) {
  const ColourwaySource tiny = source();
  const auto expected = yarn_colours(tiny.contents.database, 1, 2);
  const auto found =
      response().colours(tiny.contents.database.materials, tiny.contents.database.transfer);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t yarn = 0; yarn < found.size(); ++yarn) {
    EXPECT_EQ(found[yarn].share, expected[yarn].share);
    for (int c = 0; c < 3; ++c) {
      // Pixels are cut at 0, which makes them brighter; means are not.
      EXPECT_LE(found[yarn].linear[c], 1.002 * expected[yarn].linear[c]);
      EXPECT_GE(found[yarn].linear[c], 0.9 * expected[yarn].linear[c]);
    }
  }
}

TEST_F(RecolorTest, AYarnThatIsNotNamed_KeepsItsFibres) {
  const ColourwaySource tiny = source();
  const ColourwayRequest request = request_of(tiny, {"warp=#305030"});
  const ColourFit found = fit(request);
  for (std::size_t m = 0; m < tiny.contents.database.materials.size(); ++m) {
    const bool is_warp = tiny.contents.database.material_names[m] == "indigo";
    EXPECT_EQ(found.materials[m] == tiny.contents.database.materials[m], !is_warp);
  }
}

TEST_F(RecolorTest, CarriedOverLight_IsNearTracedLight) {
  const ColourwaySource tiny = source();
  const ColourwayRequest request = request_of(tiny, {"all=#7a1f2b"});
  const ColourFit found = fit(request);
  storage::RecolourableDatabase carried = carried_colourway(request, found);
  make(recolored_description(request, found), *folder_ / "exact.h5");
  const storage::FabricDatabase exact = storage::read_database(*folder_ / "exact.h5");
  EXPECT_EQ(exact.materials, carried.database.materials);
  const std::size_t entries = exact.transfer.size() / exact.cell_paths.size() / 3;
  // Red fibres of a dark blue cloth, the hard way round: 6 % were measured.
  constexpr double kLargest = 0.1;
  for (std::size_t c = 0; c < 3; ++c) {
    double traced = 0;
    double carried_light = 0;
    for (std::size_t cell = 0; cell < exact.cell_paths.size(); ++cell) {
      traced += exact.transfer[(cell * 3 + c) * entries];
      carried_light += carried.database.transfer[(cell * 3 + c) * entries];
    }
    EXPECT_NEAR(carried_light / traced, 1, kLargest) << "channel " << c;
  }
  const CarryError error = state_origin(request, carried);
  EXPECT_LT(std::abs(error.light), kLargest + 3 * error.light_noise);
}

TEST_F(RecolorTest, TheCommand_WritesAColourwayThatSaysWhatItIs) {
  const std::string output = *folder_ / "claret.h5";
  const Finished made = run_weft(*folder_, {"recolor", base_, "--yarn", "all=#7a1f2b", "-o", output,
                                            "--name", "claret", "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const nlohmann::json json = made.json();
  EXPECT_THAT(json["carried_over"]["from"].get<std::string>(), testing::EndsWith("tiny.h5"));
  for (const nlohmann::json& target : json["targets"]) {
    EXPECT_LT(target["delta_e_2000"].get<double>(), 1);
  }
  const Finished shown = run_weft(*folder_, {"inspect", output, "--json"});
  ASSERT_EQ(shown.code, 0) << shown.err;
  EXPECT_EQ(shown.json()["name"], "claret");
  EXPECT_EQ(shown.json()["carried_over"]["base_digest"], source().digest.hex());
  EXPECT_EQ(shown.json()["can_be_recolored"], false);
  EXPECT_THAT(run_weft(*folder_, {"inspect", output}).out, HasSubstr("carried over"));
  EXPECT_EQ(run_weft(*folder_, {"verify", output}).code, 0);
  // Of a colourway: the file with the paths' light is asked for.
  const Finished of_colourway =
      run_weft(*folder_, {"recolor", output, "--yarn", "all=#fff", "-o", output});
  EXPECT_EQ(of_colourway.code, core::kExitFailed);
  EXPECT_THAT(of_colourway.err, HasSubstr("tiny.h5"));
}

TEST_F(RecolorTest, OfAPublishedVersion_ColoursAreCarriedOrTraced) {
  const TestFolder folder;
  const TestCluster cluster(folder, "colours", 1);
  const std::string description = write_description(folder, "512");
  ASSERT_EQ(cluster.weft({"submit", description, "--wait", "--quality", "preview"}).code, 0);
  const std::string fetched = folder / "claret.h5";
  const Finished carried =
      cluster.weft({"recolor", "tiny", "--yarn", "warp=#7a1f2b", "-o", fetched, "--json"});
  ASSERT_EQ(carried.code, 0) << carried.err;
  EXPECT_EQ(carried.json()["carried_over"]["from"], "tiny@1");
  // Other colours of a colourway come from its base, which is fetched.
  const auto base = base_of(open_colourway_source(fetched, cluster.address()), cluster.address());
  ASSERT_TRUE(base.has_value());
  EXPECT_EQ(base->reference, "tiny@1");
  EXPECT_TRUE(base->contents.recolouring.has_orders());
  const Finished exact =
      cluster.weft({"recolor", "tiny@1", "--yarn", "warp=#7a1f2b", "--exact", "--json"});
  ASSERT_EQ(exact.code, 0) << exact.err;
  EXPECT_THAT(exact.json()["version"], testing::StartsWith("tiny@"));
  EXPECT_LT(exact.json()["targets"][0]["delta_e_2000"].get<double>(), 1);
}

TEST_F(RecolorTest, WrongUse_IsRefusedWithWhatWouldBeRight) {
  const std::string output = *folder_ / "never.h5";
  const auto error = [&](const std::vector<std::string>& yarns) {
    std::vector<std::string> arguments{"recolor", base_, "-o", output};
    for (const std::string& yarn : yarns) {
      arguments.insert(arguments.end(), {"--yarn", yarn});
    }
    const Finished finished = run_weft(*folder_, arguments);
    EXPECT_EQ(finished.code, core::kExitFailed) << finished.out;
    EXPECT_FALSE(std::filesystem::exists(output));
    return finished.err;
  };
  EXPECT_THAT(error({"warpp=#fff"}), HasSubstr("did you mean \"warp\""));
  EXPECT_THAT(error({"warp=red"}), HasSubstr("is no colour"));
  EXPECT_THAT(error({"#7a1f2b"}), HasSubstr("write YARN=COLOUR"));
  EXPECT_THAT(error({"warp=#111", "all=#222"}), HasSubstr("has got a colour already"));
  const Finished too_bright = run_weft(
      *folder_, {"recolor", base_, "--yarn", "all=#ffffff", "--exposure", "1", "-o", output});
  EXPECT_EQ(too_bright.code, core::kExitFailed);
  EXPECT_THAT(too_bright.err, HasSubstr("--nearest"));
  EXPECT_EQ(run_weft(*folder_, {"recolor", base_, "-o", output}).code, core::kExitWrongUse);
  EXPECT_EQ(
      run_weft(*folder_, {"recolor", *folder_ / "none.h5", "--yarn", "all=#111", "-o", output})
          .code,
      core::kExitNotFound);
}

TEST_F(RecolorTest, YarnsOfOneMaterial_TakeOneColour) {
  ColourwaySource shared = source();
  for (std::size_t i = 0; i < shared.contents.database.strands.size(); i += 3) {
    shared.contents.database.strands[i + 1] = 0;
  }
  EXPECT_EQ(colour_targets({"all=#123456"}, shared.contents.database).size(), 1U);
  EXPECT_EQ(colour_targets({"warp=#123456", "weft=#123456"}, shared.contents.database).size(), 1U);
  const auto refusal = [&](const std::vector<std::string>& requests) {
    try {
      (void)colour_targets(requests, shared.contents.database);
    } catch (const core::Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal({"warp=#123456"}), HasSubstr("are of one material"));
  EXPECT_THAT(refusal({"warp=#123456", "weft=#654321"}), HasSubstr("cannot have two colours"));
}

}  // namespace
}  // namespace weft::cli
