#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "cli/fabric_reference.h"
#include "core/error.h"

namespace weft::cli {
namespace {

TEST(FabricReference, NamesWithAndWithoutVersionAreRead) {
  EXPECT_EQ(parse_reference("silk"), (FabricReference{"silk", std::nullopt}));
  EXPECT_EQ(parse_reference("silk@latest"), (FabricReference{"silk", std::nullopt}));
  EXPECT_EQ(parse_reference("satin_4-1@12"), (FabricReference{"satin_4-1", 12}));
  EXPECT_EQ(parse_reference("silk:a-b_c.1"), (FabricReference{"silk", std::nullopt, "a-b_c.1"}));
}

TEST(FabricReference, WhatIsNoReferenceIsRefused) {
  for (const char* text : {"",
                           "@",
                           "@3",
                           "silk@",
                           "silk@0",
                           "silk@03",
                           "silk@-1",
                           "silk@3x",
                           "silk@Latest",
                           "Silk",
                           "-silk",
                           "silk.h5",
                           "./silk",
                           "a/b",
                           "silk@3@4",
                           "silk@9999999999999999999",
                           "silk:",
                           "silk:3",
                           "silk:latest",
                           "silk:Good",
                           "silk:a@1",
                           "silk:a/b"}) {
    EXPECT_FALSE(parse_reference(text)) << text;
  }
  EXPECT_TRUE(parse_reference(std::string(64, 'a')));
  EXPECT_FALSE(parse_reference(std::string(65, 'a')));
}

TEST(FabricReference, APathIsItselfAndNeedsNoCoordinator) {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / "weft_reference_test.h5";
  std::ofstream(path) << "x";
  EXPECT_EQ(resolve_fabric(path.string(), "127.0.0.1:1"), path);
  std::filesystem::remove(path);
}

TEST(FabricReference, AMissingFileAFolderAndAnAbsentCoordinatorAreToldApart) {
  const auto code_of = [](const std::string& reference) {
    try {
      (void)resolve_fabric(reference, "127.0.0.1:1");
    } catch (const core::Error& error) {
      return error.code();
    }
    return core::Code::kInternal;
  };
  EXPECT_EQ(code_of("./no_such_fabric.h5"), core::Code::kNotFound);
  EXPECT_EQ(code_of(testing::TempDir()), core::Code::kInvalidArgument);
  EXPECT_EQ(code_of("silk@3"), core::Code::kUnavailable);
}

}  // namespace
}  // namespace weft::cli
