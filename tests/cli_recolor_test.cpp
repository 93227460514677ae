#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include "cli/local_run.h"
#include "cli/make_colourway.h"
#include "cli/split_materials.h"
#include "cli/swatch_colour.h"
#include "client/publish_colourway.h"
#include "core/error.h"
#include "core/exit_code.h"
#include "core/file.h"
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

  static const ColourwayModel& model() {
    static const ColourwaySource tiny = source();
    static const ColourwayModel made(tiny, 2);
    return made;
  }

  static ColourwayRequest request_of(const std::vector<std::string>& yarns) {
    return {&model().base, colour_targets(yarns, model().base.contents.database), "tiny",
            own_exposure(model())};
  }

  static ColourFit fit(const ColourwayRequest& request) {
    return fit_colourway(model(), request, {},
                         std::vector<glm::dvec3>(request.targets.size(), glm::dvec3(1)));
  }

  static inline TestFolder* folder_ = nullptr;
  static inline ResultCache* cache_ = nullptr;
  static inline std::string base_;
};

TEST_F(RecolorTest, ColoursThatAreAskedFor_AreShown) {
  const ColourwayRequest request = request_of({"warp=#7a1f2b", "weft=lab:40,-10,-15"});
  ASSERT_EQ(request.targets.size(), 2U);
  // Drawn from what was made, not what the fit expects.
  EXPECT_LT(carry_colourway(model(), request).fit.worst_delta_e(), 1);
}

TEST_F(RecolorTest, TheSameRequest_GivesTheSameBytes) {
  const ColourwayRequest request = request_of({"warp=#305030"});
  const auto write = [&](const std::string& name) {
    const storage::RecolourableDatabase made = carry_colourway(model(), request).contents;
    return storage::write_database(made.database, made.recolouring, *folder_ / name);
  };
  EXPECT_EQ(write("one.h5"), write("two.h5"));
}

TEST_F(RecolorTest, TheResponse_IsThatOfPictures) {
  const storage::FabricDatabase& tiny = model().base.contents.database;
  const auto expected = yarn_colours(tiny, 1, 2);
  const auto found = model().response.colours(tiny.materials, model().carrier.sums(tiny.materials));
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
  const ColourwayRequest request = request_of({"warp=#305030"});
  const ColourFit found = fit(request);
  for (std::size_t m = 0; m < model().base.contents.database.materials.size(); ++m) {
    const bool is_warp = model().base.contents.database.material_names[m] == "indigo";
    EXPECT_EQ(found.materials[m] == model().base.contents.database.materials[m], !is_warp);
  }
}

TEST_F(RecolorTest, CarriedOverLight_IsNearTracedLight) {
  const ColourwayRequest request = request_of({"all=#7a1f2b"});
  const CarriedColourway carried = carry_colourway(model(), request);
  make(recolored_description(request, carried.fit), *folder_ / "exact.h5");
  const storage::FabricDatabase exact = storage::read_database(*folder_ / "exact.h5");
  EXPECT_EQ(exact.materials, carried.contents.database.materials);
  const std::size_t entries = exact.transfer.size() / exact.cell_paths.size() / 3;
  // Red fibres of a dark blue cloth, the hard way round: 6 % were measured.
  constexpr double kLargest = 0.1;
  for (std::size_t c = 0; c < 3; ++c) {
    double traced = 0;
    double carried_light = 0;
    for (std::size_t cell = 0; cell < exact.cell_paths.size(); ++cell) {
      traced += exact.transfer[(cell * 3 + c) * entries];
      carried_light += carried.contents.database.transfer[(cell * 3 + c) * entries];
    }
    EXPECT_NEAR(carried_light / traced, 1, kLargest) << "channel " << c;
  }
  EXPECT_LT(std::abs(carried.error.light), kLargest + 3 * carried.error.light_noise);
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

TEST_F(RecolorTest, OfAPublishedVersion_LightIsCarriedIntoAFile) {
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
}

TEST_F(RecolorTest, OfAPublishedVersion_ACarriedOverOneIsPublished) {
  const TestFolder folder;
  const std::string file = folder / "claret.h5";
  const std::string fetched = folder / "fetched.h5";
  const std::vector<std::string> claret{"recolor", "tiny", "--yarn", "warp=#7a1f2b"};
  const auto with = [&claret](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = claret;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  {
    const TestCluster cluster(folder, "kept", 1);
    const std::string description = write_description(folder, "512");
    ASSERT_EQ(cluster.weft({"submit", description, "--wait", "--quality", "preview"}).code, 0);
    ASSERT_EQ(cluster.weft(with({"-o", file})).code, 0);
    const Finished made = cluster.weft(with({"--json"}));
    ASSERT_EQ(made.code, 0) << made.err;
    EXPECT_EQ(made.json()["version"], "tiny@2");
    EXPECT_TRUE(made.json()["output"].is_null());
    EXPECT_EQ(made.json()["carried_over"]["from"], "tiny@1");
    EXPECT_LT(made.json()["targets"][0]["delta_e_2000"].get<double>(), 1);
    EXPECT_EQ(made.json()["content_digest"], storage::content_digest(file).hex());
  }
  // Another process on the same folder has it, and says what it is.
  const TestCluster cluster(folder, "kept", 0);
  ASSERT_EQ(cluster.weft({"fetch", "tiny@2", "-o", fetched}).code, 0);
  EXPECT_EQ(core::read_file(fetched), core::read_file(file));
  EXPECT_THAT(cluster.weft({"versions", "tiny"}).out, HasSubstr("light of tiny@1"));
  EXPECT_THAT(cluster.weft({"log", "tiny"}).out, HasSubstr("colourway of tiny@1: warp=#7a1f2b"));
  EXPECT_EQ(cluster.weft({"versions", "tiny", "--json"}).json()[0]["carried_over_from"], "tiny@1");
  EXPECT_EQ(cluster.weft({"tag", "tiny@2", "claret"}).code, 0);
  EXPECT_THAT(cluster.weft({"diff", "tiny@1", "tiny:claret"}).out, HasSubstr("/iirtf/transfer"));
  // Of the colourway: its base is found, and its other yarn keeps its colour.
  const Finished second =
      cluster.weft({"recolor", "tiny@2", "--yarn", "weft=#305030", "--name", "moss", "--json"});
  ASSERT_EQ(second.code, 0) << second.err;
  EXPECT_EQ(second.json()["version"], "moss@1");
  EXPECT_EQ(second.json()["carried_over"]["from"], "tiny@1");
}

TEST_F(RecolorTest, ACoordinatorThatTakesNoColourways_IsNamedWithWhatToDo) {
  // Every call of a service that nobody has written answers as an older program's does.
  v1::CatalogueService::Service older;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&older);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  client::Coordinator coordinator(security::Endpoint("127.0.0.1:" + std::to_string(port)));
  try {
    (void)client::publish_colourway(coordinator, {base_, source().digest, "tiny", "tiny@1", ""});
    ADD_FAILURE() << "it was published";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kFailedPrecondition);
    EXPECT_THAT(error.what(),
                testing::AllOf(HasSubstr("older"), HasSubstr("-o FILE.h5"), HasSubstr("--exact")));
  }
}

TEST_F(RecolorTest, OfFewPaths_WhatCanBeShownIsNotRefused) {
  const TestFolder folder;
  const std::string path = folder / "few.h5";
  make(fabric::load_description(write_description(folder, "512"), v1::QUALITY_PREVIEW), path);
  const ColourwaySource few = open_colourway_source(path, {});
  const ColourwayModel of_few(few, 2);
  for (const char* colour : {"all=#e8e4d8", "all=#1040c0"}) {
    const ColourwayRequest request{&few, colour_targets({colour}, few.contents.database), "tiny",
                                   own_exposure(of_few)};
    EXPECT_LT(carry_colourway(of_few, request).fit.worst_delta_e(), 1) << colour;
  }
}

TEST_F(RecolorTest, TheNearestThatIsTraced_IsWhatWasAskedForWhereItCanBeShown) {
  const TestFolder folder;
  const std::string path = folder / "few.h5";
  const std::string output = folder / "claret.h5";
  make(fabric::load_description(write_description(folder, "512"), v1::QUALITY_PREVIEW), path);
  const Finished made = run_weft(folder, {"recolor", path, "--yarn", "all=#7a1f2b", "--exact",
                                          "--nearest", "-o", output, "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const double exposure = made.json()["exposure"];
  const ColourwaySource few = open_colourway_source(path, {});
  const auto targets = colour_targets({"all=#7a1f2b"}, few.contents.database);
  const auto shown =
      target_colours(targets, yarn_colours(storage::read_database(output), exposure, 2));
  ASSERT_EQ(shown.size(), made.json()["targets"].size());
  for (std::size_t t = 0; t < shown.size(); ++t) {
    const double delta_e = shading::delta_e_2000(shading::lab_from_linear(shown[t]),
                                                 shading::lab_from_linear(targets[t].linear));
    EXPECT_LT(delta_e, 1);
    EXPECT_NEAR(made.json()["targets"][t]["delta_e_2000"].get<double>(), delta_e, 1e-6);
  }
}

TEST_F(RecolorTest, OfAPublishedVersion_ANewOneIsTraced) {
  const TestFolder folder;
  const TestCluster cluster(folder, "exact", 1);
  const std::string description = write_description(folder, "512");
  ASSERT_EQ(cluster.weft({"submit", description, "--wait", "--quality", "preview"}).code, 0);
  const Finished exact =
      cluster.weft({"recolor", "tiny@1", "--yarn", "warp=#7a1f2b", "--exact", "--json"});
  ASSERT_EQ(exact.code, 0) << exact.err;
  EXPECT_EQ(exact.json()["exact"], true);
  EXPECT_TRUE(exact.json()["carried_over"].is_null());
  EXPECT_LT(exact.json()["targets"][0]["delta_e_2000"].get<double>(), 1);
  const std::string version = exact.json()["version"].get<std::string>();
  EXPECT_THAT(version, testing::StartsWith("tiny@"));
  EXPECT_THAT(cluster.weft({"log", "tiny"}).out, HasSubstr("colourway of tiny@1"));
  // It is a version like others; its visibility is that of the first one, and its light its own.
  ASSERT_EQ(cluster.weft({"fetch", "tiny@1", "-o", folder / "first.h5"}).code, 0);
  ASSERT_EQ(cluster.weft({"fetch", version, "-o", folder / "claret.h5"}).code, 0);
  EXPECT_EQ(run_weft(folder, {"verify", folder / "claret.h5"}).code, 0);
  const storage::FabricDatabase first = storage::read_database(folder / "first.h5");
  const storage::RecolourableDatabase claret = storage::read_recolourable(folder / "claret.h5");
  EXPECT_EQ(claret.database.ssdf, first.ssdf);
  EXPECT_EQ(claret.database.points_mm, first.points_mm);
  EXPECT_NE(claret.database.transfer, first.transfer);
  EXPECT_NE(claret.database.materials, first.materials);
  EXPECT_TRUE(claret.recolouring.has_orders());
  EXPECT_TRUE(claret.recolouring.carried_over_json.empty());
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

// tiny with both yarns of one material.
std::string one_material_description(const TestFolder& folder) {
  std::string text = core::read_file(write_description(folder, "2048"));
  const std::string other = "material: \"straw\"";
  text.replace(text.find(other), other.size(), "material: \"indigo\"");
  const std::string path = folder / "one.textproto";
  core::write_file_atomically(path, text);
  return path;
}

TEST_F(RecolorTest, YarnsOfOneMaterial_AreDyedApart) {
  const TestFolder folder;
  const v1::FabricDescription description =
      fabric::load_description(one_material_description(folder), v1::QUALITY_PREVIEW);
  const std::string path = folder / "one.h5";
  make(description, path);
  const std::string output = folder / "two.h5";
  const Finished made = run_weft(folder, {"recolor", path, "--yarn", "warp=#7a1f2b", "--yarn",
                                          "weft=#30507a", "-o", output, "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  ASSERT_EQ(made.json()["targets"].size(), 2U);
  for (const nlohmann::json& target : made.json()["targets"]) {
    EXPECT_LT(target["delta_e_2000"].get<double>(), 1);
  }
  EXPECT_LT(std::abs(made.json()["carried_over"]["light_error"].get<double>()), 0.15);
  const ColourwaySource two = open_colourway_source(output, {});
  EXPECT_EQ(two.contents.database.material_names,
            (std::vector<std::string>{"indigo", "indigo_weft"}));
  EXPECT_EQ(two.description.yarns(1).material(), "indigo_weft");
  // The description in it makes the same fibres, of these materials.
  make(two.description, folder / "traced.h5");
  const storage::FabricDatabase traced = storage::read_database(folder / "traced.h5");
  EXPECT_EQ(traced.materials, two.contents.database.materials);
  EXPECT_EQ(traced.strands, two.contents.database.strands);
  EXPECT_EQ(traced.points_mm, two.contents.database.points_mm);
  // A further colour of one of them is carried over from the base, which is split as it was.
  ColourwaySource base = open_colourway_source(path, {});
  split_materials(splits_between(base.contents.database, two.contents.database), base, 2);
  EXPECT_EQ(base.contents.database.strands, two.contents.database.strands);
  EXPECT_TRUE(base.contents.recolouring.has_orders());
  const ColourwayModel split(base, 2);
  const std::vector<shading::FibreMaterial>& same = base.contents.database.materials;
  EXPECT_EQ(split.carrier.matrices(split.carrier.sums(same)).transfer,
            base.contents.database.transfer);
}

TEST_F(RecolorTest, AYarnThatIsNotNamed_KeepsTheColourOfASharedMaterial) {
  storage::FabricDatabase shared = source().contents.database;
  for (std::size_t i = 0; i < shared.strands.size(); i += 3) {
    shared.strands[i + 1] = 0;
  }
  EXPECT_TRUE(material_splits({"all=#123456"}, shared).empty());
  EXPECT_TRUE(material_splits({"warp=#123456", "weft=#123456"}, shared).empty());
  EXPECT_EQ(colour_targets({"all=#123456"}, shared).size(), 1U);
  const std::vector<MaterialSplit> splits = material_splits({"warp=#123456"}, shared);
  ASSERT_EQ(splits.size(), 1U);
  EXPECT_EQ(splits[0].material, 0U);
  EXPECT_EQ(splits[0].yarns, std::set<std::size_t>{0});
  EXPECT_EQ(splits[0].name, "indigo_warp");
}

}  // namespace
}  // namespace weft::cli
