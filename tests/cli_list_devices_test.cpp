#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/exit_code.h"
#include "core/file.h"
#include "tests/cli_programs.h"

namespace weft::cli {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

TEST(ListDevices, NamesTheOneThatIsTakenFirst) {
  const TestFolder folder;
  const Finished text = run_weft(folder, {"render", "--list-devices"});
  EXPECT_EQ(text.code, 0) << text.err;  // the tests need a driver: mesa-vulkan-drivers
  const Finished finished = run_weft(folder, {"render", "--list-devices", "--json"});
  ASSERT_EQ(finished.code, 0) << finished.err;
  const nlohmann::json devices = finished.json().at("devices");
  ASSERT_FALSE(devices.empty());
  EXPECT_EQ(devices[0].at("index"), 0);
  EXPECT_GT(devices[0].at("memory_bytes"), 0);
  EXPECT_THAT(text.out, HasSubstr(devices[0].at("name").get<std::string>()));
}

TEST(ListDevices, SaysWhatToInstallWhereThereIsNoDriver) {
  const TestFolder folder;
  const std::string log = folder / "weft.err";
  ChildProcess process({"/usr/bin/env", "VK_ICD_FILENAMES=/nowhere", "VK_DRIVER_FILES=/nowhere",
                        program("weft"), "render", "--list-devices"},
                       log, true);
  std::string out;
  while (const auto line = process.read_line(60)) {
    out += *line;
  }
  EXPECT_EQ(process.wait(10), core::kExitFailed);
  EXPECT_THAT(out, IsEmpty());
  EXPECT_THAT(core::read_file(log), HasSubstr("there is no Vulkan driver; install"));
  EXPECT_THAT(core::read_file(log), HasSubstr("mesa-vulkan-drivers"));
}

}  // namespace
}  // namespace weft::cli
