#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/error.h"
#include "storage/database_summary.h"
#include "storage/fabric_database.h"
#include "tests/storage_test_database.h"

namespace weft::storage {
namespace {

using testing::HasSubstr;

struct Hostile {
  const char* name;      // a way of tests/storage_hostile.py
  const char* expected;  // part of the sentence that refuses it
};

constexpr Hostile kHostile[] = {
    {"missing_dataset", "dataset /cells/coordinates is missing"},
    {"missing_group", "dataset /visibility is missing"},
    {"soft_link", "dataset /cells/coordinates is a link that leads elsewhere"},
    {"soft_link_cycle", "dataset /cells is a link that leads elsewhere"},
    {"hard_link_cycle", "dataset \"/cells/again\" is nothing that fabric databases have"},
    {"external_link", "dataset /cells/coordinates is a link that leads elsewhere"},
    {"external_group", "dataset /cells is a link that leads elsewhere"},
    {"external_storage", "/visibility/ssdf/basis is not stored in chunks inside the file"},
    {"virtual_dataset", "/visibility/ssdf/basis is not stored in chunks inside the file"},
    {"compact_storage", "/cells/coordinates is not stored in chunks inside the file"},
    {"filter_lzf", "/visibility/ssdf/basis uses a filter that fabric databases do not have"},
    {"filter_scale_offset", "/cells/coordinates uses a filter that fabric databases do not have"},
    {"filter_of_a_plug_in", "/visibility/ssdf/basis uses a filter that fabric databases do not"},
    {"huge_shape", "/exemplar/points_mm claims the shape"},
    {"shape_that_overflows", "/exemplar/points_mm claims the shape"},
    {"missing_chunk", "/exemplar/points_mm has 1 chunks where its shape needs 2"},
    {"huge_chunk", "/exemplar/points_mm has chunks above the limit"},
    {"deflate_bomb", "/exemplar/points_mm and those before it unfold to more than the limit"},
    {"chunk_that_inflates_beyond_itself", "/exemplar/points_mm is damaged"},
    {"chunk_without_its_filters", "/exemplar/points_mm has chunks that are shorter or longer"},
    {"chunk_without_its_deflation", "/exemplar/points_mm has chunks that are shorter or longer"},
    {"chunk_longer_than_its_data", "/exemplar/points_mm has chunks of impossible lengths"},
    {"type_wider", "/visibility/ssdf/basis has elements f64 where f32 was expected"},
    {"type_big_endian", "/visibility/ssdf/basis has elements of a kind"},
    {"type_compound", "/cells/coordinates has elements of a kind"},
    {"type_reference", "/cells/coordinates has elements of a kind"},
    {"type_variable_length", "/cells/coordinates has elements of a kind"},
    {"type_variable_text", "/provenance/description has elements of a kind"},
    {"wrong_rank", "/visibility/ssdf/basis has shape"},
    {"scalar", "/cells/mean_free_path_mm has no usable shape"},
    {"empty", "/exemplar/points_mm is empty"},
    {"group_in_place_of_a_dataset", "/cells/coordinates cannot be opened"},
    {"dataset_in_place_of_a_group", "/cells is missing or no group"},
    {"not_a_number", "/visibility/ssdf/basis is wrong: a number is not finite"},
    {"infinite_point", "/exemplar/points_mm is wrong: a number is not finite"},
    {"infinite_half", "/iirtf/transfer is wrong: a number is not finite"},
    {"cell_out_of_range", "/cells/cell_of_segment is wrong: a cell is missing"},
    {"strands_that_overflow", "/exemplar/strands is wrong: the strands do not add up"},
    {"yarn_out_of_range", "/exemplar/threads is wrong: a yarn is missing"},
    {"contradicting_counts", "/visibility/ssdf/coefficients has shape"},
    {"terminal_codes_in_a_name", "/exemplar/material_names is wrong: a text has control"},
    {"text_of_another_kind", "/exemplar/material_names has elements of a kind"},
    {"huge_attribute", "/cells/coordinates has more or larger attributes"},
    {"many_attributes", "/cells has more or larger attributes"},
    {"many_objects", "/cells is a group of more than 64 entries"},
    {"deep_groups", "\"/cells/deeper\" is nothing that fabric databases have"},
    {"with_another_user_block", "HDF5 cannot open it"},
    {"cut_short", "HDF5 cannot open it"},
    {"without_hdf5", "HDF5 cannot open it"},
};

template <class Function>
std::string complaint(Function function) {
  try {
    function();
  } catch (const core::Error& error) {
    return error.what();
  }
  return "";
}

// The files are made once for all that is asked of them: that takes longer than the rest.
TEST(HostileDatabases, EachIsRefusedWithASentenceAndLittleMemory) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("weft_hostile_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  write_database(small_database(), folder / "whole.h5");
  if (std::system("/usr/bin/python3 -c 'import h5py' 2>/dev/null") != 0) {  // NOLINT
    GTEST_SKIP() << "/usr/bin/python3 has no h5py";
  }
  const std::string command = "/usr/bin/python3 " WEFT_SOURCE_DIR "/tests/storage_hostile.py " +
                              (folder / "whole.h5").string() + " " + folder.string();
  ASSERT_EQ(std::system(command.c_str()), 0);  // NOLINT
  EXPECT_EQ(complaint([&] { verify_database(folder / "untouched.h5"); }), "");
  for (const Hostile& hostile : kHostile) {
    const std::filesystem::path path = folder / (std::string(hostile.name) + ".h5");
    const std::string what = complaint([&] { verify_database(path); });
    EXPECT_THAT(what, HasSubstr(hostile.expected)) << hostile.name;
    EXPECT_THAT(what, HasSubstr(path.string())) << hostile.name;
    EXPECT_EQ(complaint([&] { static_cast<void>(read_database(path)); }), what) << hostile.name;
    complaint([&] { static_cast<void>(stored_datasets(path)); });  // whatever it says
  }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    getrusage(who, &used);
    EXPECT_LT(used.ru_maxrss >> 10, who == RUSAGE_SELF ? 128 : 640) << "MiB";
  }
#endif
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace weft::storage
