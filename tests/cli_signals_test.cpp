#include <csignal>
#include <filesystem>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "render/image.h"
#include "tests/cli_programs.h"
#include "tests/cli_stalling_proxy.h"
#include "tests/render_lonely_fibre.h"

// SIGINT and SIGTERM, sent to `weft fetch` and `weft render` while they are at it.

namespace weft::cli {
namespace {

namespace fs = std::filesystem;

// Whether `holds` comes true before the process ends.
bool comes_true(ChildProcess& process, const std::function<bool()>& holds) {
  while (!holds()) {
    if (process.wait(0.02)) {
      return holds();
    }
  }
  return true;
}

std::uintmax_t size_of(const std::string& path) {
  std::error_code failure;
  const std::uintmax_t bytes = fs::file_size(path, failure);
  return failure ? 0 : bytes;
}

// A published version that was computed once for all tests.
class Signals : public testing::Test {
 protected:
  struct Published {
    TestFolder folder;
    TestCluster cluster{folder, "signals", 1};
    std::string digest;
  };
  static void SetUpTestSuite() {
    published_ = std::make_unique<Published>();
    const Finished submitted = published_->cluster.weft(
        {"submit", write_description(published_->folder, "256"), "--wait"});
    ASSERT_EQ(submitted.code, 0) << submitted.err;
    const Finished listed = published_->cluster.weft({"versions", "tiny", "--json"});
    ASSERT_EQ(listed.code, 0) << listed.err;
    published_->digest = listed.json().at(0).at("content_digest");
  }
  static void TearDownTestSuite() { published_.reset(); }

  static TestCluster& cluster() { return published_->cluster; }
  static const TestFolder& folder() { return published_->folder; }
  [[nodiscard]] static std::string part_of(const std::string& output) {
    return output + "." + published_->digest.substr(0, 16) + ".part";
  }
  static int port() {
    const std::string address = cluster().address();
    return std::stoi(address.substr(address.rfind(':') + 1));
  }

  static std::unique_ptr<Published> published_;
};

std::unique_ptr<Signals::Published> Signals::published_;

TEST_F(Signals, AFetchIsLeftWithAPartAndGoesOnFromThere) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string output = folder() / ("out" + std::to_string(signal) + ".h5");
    const std::string log = output + ".log";
    const StallingProxy line(port(), 300'000);
    ChildProcess fetch(
        {program("weft"), "fetch", "tiny@1", "-o", output, "--coordinator", line.address()}, log,
        false);
    ASSERT_TRUE(comes_true(fetch, [&] { return size_of(part_of(output)) > 0; }))
        << core::read_file(log);
    fetch.signal(signal);
    EXPECT_EQ(fetch.wait(60), 1);
    EXPECT_NE(core::read_file(log).find("run the same command again to go on"), std::string::npos)
        << core::read_file(log);
    EXPECT_FALSE(fs::exists(output));
    const Finished again = cluster().weft({"fetch", "tiny@1", "-o", output, "--json"});
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_GT(again.json().at("bytes_kept"), 0);
    EXPECT_FALSE(fs::exists(part_of(output)));
  }
}

TEST_F(Signals, AFetchFromACoordinatorThatSaysNothingIsLeftAllTheSame) {
  const std::string output = folder() / "silent.h5";
  const std::string log = output + ".log";
  const StallingProxy line(port(), 0);
  ChildProcess fetch(
      {program("weft"), "fetch", "tiny@1", "-o", output, "--coordinator", line.address()}, log,
      false);
  ASSERT_TRUE(comes_true(fetch, [&] { return line.was_asked(); })) << core::read_file(log);
  fetch.signal(SIGTERM);
  EXPECT_EQ(fetch.wait(15), 1);
  EXPECT_FALSE(fs::exists(output));
}

TEST_F(Signals, APictureOfANodeIsLeftWithItsLastWholePass) {
  ChildProcess node({program("weft-render"), "--listen", "127.0.0.1:0", "--coordinator",
                     cluster().address(), "--cache", folder() / "node-cache", "--device", "cpu"},
                    folder() / "node.log", true);
  const std::string ready = node.read_line(20).value_or("");
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string picture = folder() / ("node" + std::to_string(signal) + ".exr");
    const std::string log = picture + ".log";
    ChildProcess render(
        {program("weft"), "render", "tiny@1", "--node", ready.substr(ready.rfind(' ') + 1),
         "--size", "16x16", "--spp", "1048576", "--progressive", "-o", picture},
        log, false);
    ASSERT_TRUE(comes_true(render, [&] { return fs::exists(picture); })) << core::read_file(log);
    render.signal(signal);
    EXPECT_EQ(render.wait(60), 1);
    EXPECT_NE(core::read_file(log).find("last whole pass"), std::string::npos)
        << core::read_file(log);
    EXPECT_EQ(render::read_exr(picture).width, 16U);
  }
  // The node has heard of it, twice, and is free for others.
  const Finished next =
      cluster().weft({"render", "tiny@1", "--node", ready.substr(ready.rfind(' ') + 1), "--size",
                      "16x16", "--spp", "1", "-o", folder() / "next.exr"});
  EXPECT_EQ(next.code, 0) << next.err;
}

TEST_F(Signals, AnAnimationIsLeftBetweenWholeFramesAndResumed) {
  const TestFolder own;
  storage::write_database(test::lonely_fibre(0.5f), own / "fibre.h5");
  const auto write_scene = [&](std::size_t frames) {
    core::write_file_atomically(own / "scene.textproto",
                                R"(camera { position { x: 1 y: 0.5 z: 8 } look_at { x: 3.2 }
                    orthographic { height_mm: 0.2 } }
           cloths { flat { size_x_mm: 10 size_y_mm: 10 centre_y_mm: -5 } }
           picture { width: 12 height: 8 samples_per_pixel: 6 }
           animation { first_frame: 1 frames: )" +
                                    std::to_string(frames) + " }");
  };
  write_scene(5000);
  const std::vector<std::string> command{
      "render", own / "fibre.h5",         "--scene", own / "scene.textproto", "--device", "cpu",
      "-o",     own / "frames/a_%04d.exr"};
  fs::create_directory(own / "frames");
  std::vector<std::string> whole{program("weft")};
  whole.insert(whole.end(), command.begin(), command.end());
  ChildProcess render(whole, own / "render.log", false);
  ASSERT_TRUE(comes_true(render, [&] { return fs::exists(own / "frames/a_0002.exr"); }))
      << core::read_file(own / "render.log");
  render.signal(SIGTERM);
  EXPECT_EQ(render.wait(60), 1);
  EXPECT_NE(core::read_file(own / "render.log").find("--resume goes on"), std::string::npos)
      << core::read_file(own / "render.log");
  std::size_t frames = 0;
  for (const auto& file : fs::directory_iterator(own / "frames")) {
    EXPECT_EQ(file.path().extension(), ".exr") << "what is half written has no name that lasts";
    EXPECT_EQ(render::read_exr(file.path()).width, 12U);
    ++frames;
  }
  EXPECT_GE(frames, 2U);
  EXPECT_LT(frames, 5000U);
  write_scene(frames + 1);
  std::vector<std::string> resumed = command;
  resumed.insert(resumed.end(), {"--resume", "--json"});
  const Finished finished = run_weft(own, resumed);
  ASSERT_EQ(finished.code, 0) << finished.err;
  EXPECT_EQ(finished.json().at("frames").at(frames - 1).at("was_there"), true);
  EXPECT_EQ(finished.json().at("frames").at(frames).at("was_there"), false);
}

}  // namespace
}  // namespace weft::cli
