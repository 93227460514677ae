#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/image.h"
#include "tests/cli_one_material.h"

namespace weft::cli {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

bool python_has(const std::string& modules) {
  return std::system(("/usr/bin/python3 -c 'import " + modules + "' 2>/dev/null").c_str()) ==
         0;  // NOLINT
}

// Output of a script of tests/ or examples/, which must succeed.
std::string python(const TestFolder& folder, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "/usr/bin/python3");
  setenv("WEFT_BIN", WEFT_BIN_DIR, 1);                 // NOLINT(concurrency-mt-unsafe)
  setenv("PYTHONPATH", WEFT_BIN_DIR "/../python", 1);  // NOLINT(concurrency-mt-unsafe)
  const std::string log = folder / "python.err";
  ChildProcess process(arguments, log, true);
  std::string out;
  while (const auto line = process.read_line(120)) {
    out += *line + "\n";
  }
  EXPECT_EQ(process.wait(10).value_or(-1), 0) << core::read_file(log);
  return out;
}

TEST(Python, TheModuleGoesTheWholeWayAndSaysWhatTheCommandLineSays) {
  if (!python_has("grpc, google.protobuf, h5py, numpy")) {
    GTEST_SKIP() << "/usr/bin/python3 has no grpc, protobuf or h5py";
  }
  const TestFolder folder;
  const TestCluster cluster(folder, "python", 2);
  ChildProcess node({program("weft-render"), "--listen", "127.0.0.1:0", "--coordinator",
                     cluster.address(), "--cache", folder / "node-cache", "--device", "cpu"},
                    folder / "node.log", true);
  const std::string ready = node.read_line(20).value_or("");
  const std::string address = ready.substr(ready.rfind(' ') + 1);
  const std::string description = write_one_material(folder, "64");
  const auto found = nlohmann::json::parse(
      python(folder, {WEFT_SOURCE_DIR "/tests/cli_python.py", cluster.address(), address,
                      description, folder.path().string()}));

  EXPECT_EQ(found["reference"], "tiny@1");
  EXPECT_EQ(found["comment"], "from Python");
  EXPECT_EQ(found["last_share"], 1);
  EXPECT_THAT(found["fabrics"].get<std::vector<std::string>>(), Contains("tiny"));
  EXPECT_EQ(found["workers"], 2);
  EXPECT_TRUE(found["again_cached"]) << "the canonical description is another fabric";
  EXPECT_EQ(found["segments"], found["segment_share"]);
  EXPECT_EQ(found["transfer_shape"][0], found["cells"]);
  EXPECT_EQ(found["grid_cells"], found["cells"]);
  EXPECT_GT(found["strands"], 0);
  EXPECT_LT(found["longest_mm"].get<double>(), 1);
  EXPECT_NEAR(found["open_share_of_map"].get<double>(), found["open_share"].get<double>(), 0.1);

  // The same picture as by the command line.
  const Finished drawn = cluster.weft({"render", "tiny@1", "--node", address, "--size", "48x32",
                                       "--spp", "2", "-o", folder / "cli.exr", "--float"});
  EXPECT_EQ(drawn.code, 0) << drawn.err;
  EXPECT_EQ(found["shape"], nlohmann::json({32, 48, 3}));
  EXPECT_THAT(found["planes"].get<std::vector<std::string>>(), Contains("standard_error"));
  const render::Image image = render::read_exr(folder / "cli.exr");
  glm::dvec3 mean(0);
  for (const glm::vec3& pixel : image.pixels) {
    mean += glm::dvec3(pixel) / static_cast<double>(image.pixels.size());
  }
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(found["mean"][static_cast<std::size_t>(c)].get<double>(), mean[c], 1e-6);
  }

  // Mistakes, in the words of the command line and with its exit codes.
  const Finished nobody = cluster.weft({"fetch", "nobody", "-o", folder / "n.h5"});
  EXPECT_EQ(found["unknown_fabric"]["exit_code"], nobody.code);
  EXPECT_THAT(nobody.err, HasSubstr(found["unknown_fabric"]["text"].get<std::string>()));
  const Finished away = run_weft(folder, {"jobs", "--coordinator", "127.0.0.1:1"});
  EXPECT_EQ(found["away"]["exit_code"], away.code);
  const std::string away_text = found["away"]["text"];
  EXPECT_THAT(away.err, HasSubstr(away_text.substr(0, away_text.find('('))));
  EXPECT_THAT(away.err, HasSubstr(away_text.substr(away_text.rfind(')'))));
  const Finished far = run_weft(folder, {"jobs", "--coordinator", "hub.example:7411"});
  EXPECT_EQ(found["far"]["exit_code"], far.code);
  EXPECT_THAT(far.err, HasSubstr(found["far"]["text"].get<std::string>()));
  EXPECT_THAT(found["bad_address"]["text"].get<std::string>(), HasSubstr("it has no port"));
  EXPECT_THAT(found["no_tls_folder"]["text"].get<std::string>(), HasSubstr("weft certs issue"));
  EXPECT_THAT(found["broken"]["text"].get<std::string>(), HasSubstr("broken.textproto:2:"));
  EXPECT_EQ(found["node_unknown"]["code"], "NOT_FOUND");
  EXPECT_THAT(found["node_missing_file"]["text"].get<std::string>(),
              HasSubstr("cannot read absent.obj"));
}

TEST(Python, TheExampleDrawsItsPlots) {
  if (!python_has("grpc, google.protobuf, h5py, matplotlib")) {
    GTEST_SKIP() << "/usr/bin/python3 has no matplotlib, grpc, protobuf or h5py";
  }
  const TestFolder folder;
  const std::string description = write_one_material(folder, "64");
  const Finished ran =
      run_weft(folder, {"run", description, "-o", folder / "tiny.h5", "--quality", "preview"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const std::string said = python(folder, {WEFT_SOURCE_DIR "/examples/look_into_a_fabric.py",
                                           folder / "tiny.h5", "-o", folder / "plots"});
  for (const char* name : {"visibility.png", "transfer.png", "cells.png"}) {
    EXPECT_THAT(said, HasSubstr(name));
    EXPECT_GT(std::filesystem::file_size(folder.path() / "plots" / name), 10'000U) << name;
  }
}

}  // namespace
}  // namespace weft::cli
