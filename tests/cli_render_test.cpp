#include <csignal>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "render/image.h"
#include "tests/cli_programs.h"
#include "tests/render_lonely_fibre.h"

// `weft render` as people use it, on a database of one fibre.

namespace weft::cli {
namespace {

class RenderCommand : public testing::Test {
 protected:
  RenderCommand() {
    storage::write_database(test::lonely_fibre(0.5f), folder_ / "fibre.h5");
    core::write_file_atomically(folder_ / "scene.textproto",
                                R"(camera { position { x: 1 y: 0.5 z: 8 } look_at { x: 3.2 }
                                            orthographic { height_mm: 0.2 } }
                                   cloths { flat { size_x_mm: 10 size_y_mm: 10 centre_y_mm: -5 } }
                                   picture { width: 12 height: 8 samples_per_pixel: 6 })");
  }

  // weft render fibre.h5 --scene scene.textproto FURTHER
  [[nodiscard]] Finished render(const std::vector<std::string>& further) const {
    std::vector<std::string> arguments{
        "render", folder_ / "fibre.h5", "--scene", folder_ / "scene.textproto", "--device", "cpu"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return run_weft(folder_, arguments);
  }
  [[nodiscard]] std::string bytes(const std::string& name) const {
    return core::read_file(folder_ / name);
  }

  TestFolder folder_;
};

TEST_F(RenderCommand, DrawsAPictureAgainFromItsHeaderByteForByte) {
  const Finished first = render({"-o", folder_ / "a.exr", "--layers", "single,segment", "--float",
                                 "--seed", "7", "--size", "9x5", "--single-only"});
  ASSERT_EQ(first.code, 0) << first.err;
  const Finished again =
      run_weft(folder_, {"render", "--again", folder_ / "a.exr", "-o", folder_ / "b.exr"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(bytes("a.exr"), bytes("b.exr"));
  EXPECT_EQ(again.err, "");
  EXPECT_EQ(render::read_exr(folder_ / "a.exr", "single").width, 9u);
}

TEST_F(RenderCommand, SaysWhenAFabricHasChangedSinceThePictureWasDrawn) {
  ASSERT_EQ(render({"-o", folder_ / "a.exr"}).code, 0);
  storage::write_database(test::lonely_fibre(0.25f), folder_ / "fibre.h5");
  const Finished again =
      run_weft(folder_, {"render", "--again", folder_ / "a.exr", "-o", folder_ / "b.exr"});
  EXPECT_EQ(again.code, 0);
  EXPECT_NE(again.err.find("fibre.h5 is not what it was"), std::string::npos) << again.err;
}

// A database that cannot be read, so that whoever reads it first says so.
TEST_F(RenderCommand, NamesWhatIsWrongWithOtherFilesBeforeItReadsTheDatabase) {
  core::write_file_atomically(folder_ / "fibre.h5", "no database");
  const std::string scene = bytes("scene.textproto");
  const auto said = [&](const std::string& text, const std::string& out = "a.exr") {
    core::write_file_atomically(folder_ / "scene.textproto", text);
    const Finished finished = render({"-o", folder_ / out});
    EXPECT_NE(finished.code, 0);
    EXPECT_FALSE(std::filesystem::exists(folder_ / out));
    return finished.err;
  };
  const auto shell = [&](const std::string& mesh) {
    return "cloths { shell { obj_file: \"" + mesh + "\" thickness_mm: 0.1 } }";
  };
  EXPECT_NE(said(scene).find("fibre.h5"), std::string::npos);
  EXPECT_NE(said(shell("missing.obj")).find("missing.obj"), std::string::npos);
  core::write_file_atomically(folder_ / "broken.obj", "v 0 0\n");
  EXPECT_NE(said(shell("broken.obj")).find("broken.obj"), std::string::npos);
  EXPECT_NE(said(scene + "lights { environment { exr_file: \"sky.exr\" } }").find("sky.exr"),
            std::string::npos);
  EXPECT_NE(said(scene, "nowhere/a.exr").find("nowhere"), std::string::npos);
  // The mesh of a frame an hour from now.
  core::write_file_atomically(folder_ / "cloth_1.obj", "");
  EXPECT_NE(said(shell("cloth_%d.obj") + "animation { first_frame: 1 frames: 2 }", "a_%d.exr")
                .find("cloth_2.obj"),
            std::string::npos);
}

TEST_F(RenderCommand, PassesEndInTheSamePicture) {
  ASSERT_EQ(render({"-o", folder_ / "a.exr", "--png", folder_ / "a.png"}).code, 0);
  ASSERT_EQ(render({"-o", folder_ / "b.exr", "--png", folder_ / "b.png", "--progressive"}).code, 0);
  EXPECT_EQ(bytes("a.exr"), bytes("b.exr"));
  EXPECT_EQ(bytes("a.png"), bytes("b.png"));
}

TEST_F(RenderCommand, AnInterruptKeepsTheLastWholePass) {
  ChildProcess process(
      {program("weft"), "render", folder_ / "fibre.h5", "--scene", folder_ / "scene.textproto",
       "--device", "cpu", "--spp", "1048576", "--progressive", "-o", folder_ / "a.exr"},
      folder_ / "render.err", false);
  while (!std::filesystem::exists(folder_ / "a.exr") && !process.exit_code()) {
    static_cast<void>(process.wait(0.02));
  }
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(60), 1);
  EXPECT_NE(bytes("render.err").find("last whole pass"), std::string::npos) << bytes("render.err");
  // What is kept can be drawn again: its header says how many samples it has.
  const Finished again =
      run_weft(folder_, {"render", "--again", folder_ / "a.exr", "-o", folder_ / "b.exr"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(bytes("a.exr"), bytes("b.exr"));
}

TEST_F(RenderCommand, AnAnimationWritesItsFramesAndGoesOnWhereItWasBrokenOff) {
  core::write_file_atomically(folder_ / "scene.textproto",
                              bytes("scene.textproto") +
                                  R"( lights { directional { towards { x: 0.3 z: 1 } } }
              animation { first_frame: 8 frames: 3
                lights { frame: 8 value { directional { towards { x: 0.3 z: 1 } } } }
                lights { frame: 10 value { directional { towards { x: 0.3 y: 1 z: 1 } } } } })");
  EXPECT_EQ(render({"-o", folder_ / "a.exr"}).code, 1);
  const Finished first = render({"-o", folder_ / "a_%03d.exr", "--json"});
  ASSERT_EQ(first.code, 0) << first.err;
  ASSERT_EQ(first.json().at("frames").size(), 3u);
  EXPECT_EQ(first.json().at("frames").at(1).at("frame"), 9);
  EXPECT_NE(render::read_exr(folder_ / "a_008.exr").pixels,
            render::read_exr(folder_ / "a_010.exr").pixels);
  std::filesystem::remove(folder_ / "a_009.exr");
  const Finished resumed = render({"-o", folder_ / "a_%03d.exr", "--json", "--resume"});
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(resumed.json().at("frames").at(i).at("was_there"), i != 1);
  }
  const Finished other = render({"-o", folder_ / "a_%03d.exr", "--json", "--resume", "--spp", "2"});
  EXPECT_EQ(other.json().at("frames").at(0).at("was_there"), false);
  // A frame alone, from its header.
  const Finished alone =
      run_weft(folder_, {"render", "--again", folder_ / "a_009.exr", "-o", folder_ / "b.exr"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_EQ(bytes("a_009.exr"), bytes("b.exr"));
}

TEST_F(RenderCommand, ANodeGivesTheSameBytes) {
  const TestCluster cluster(folder_, "node", 1);
  const std::string fabric = write_description(folder_, "64");
  const Finished submitted = cluster.weft({"submit", fabric, "--wait"});
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  ChildProcess node({program("weft-render"), "--listen", "127.0.0.1:0", "--coordinator",
                     cluster.address(), "--cache", folder_ / "cache"},
                    folder_ / "node.log", true);
  const std::string ready = node.read_line(20).value_or("");
  const std::string address = ready.substr(ready.rfind(' ') + 1);
  const auto drawn = [&](const std::string& name, const std::vector<std::string>& further) {
    std::vector<std::string> arguments{"render",   "tiny",
                                       "--size",   "24x16",
                                       "--spp",    "2",
                                       "--layers", "all",
                                       "-o",       folder_ / (name + ".exr"),
                                       "--png",    folder_ / (name + ".png")};
    arguments.insert(arguments.end(), further.begin(), further.end());
    const Finished finished = cluster.weft(arguments);
    EXPECT_EQ(finished.code, 0) << finished.err;
    return bytes(name + ".exr") + bytes(name + ".png");
  };
  const std::string here = drawn("here", {});
  EXPECT_EQ(drawn("there", {"--node", address}), here);
  EXPECT_EQ(drawn("passes", {"--node", address, "--progressive"}), here);
  node.signal(SIGTERM);
  EXPECT_EQ(node.wait(20), 0);
}

}  // namespace
}  // namespace weft::cli
