#include <filesystem>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "tests/cli_programs.h"

// Ten colours of one cloth, through real processes: what is computed, kept and fetched once.

namespace weft::cli {
namespace {

constexpr int kColours = 10;

class Versions : public testing::Test {
 protected:
  std::string write_colour(int index) {
    std::string text = core::read_file(write_description(folder_, "64"));
    const std::string colour = "c_tt { r: 0.15 g: 0.30 b: 0.80 }";
    const std::size_t at = text.find(colour);
    EXPECT_NE(at, std::string::npos);
    text.replace(at, colour.size(),
                 "c_tt { r: 0." + std::to_string(15 + 8 * index) + " g: 0.30 b: 0.80 }");
    const std::string path = folder_ / ("colour-" + std::to_string(index) + ".textproto");
    core::write_file_atomically(path, text);
    return path;
  }
  nlohmann::json submit(int index) {
    const Finished finished = cluster_.weft(
        {"submit", write_colour(index), "--wait", "--json", "--comment", "one of ten"});
    EXPECT_EQ(finished.code, 0) << finished.err;
    return finished.json();
  }
  nlohmann::json json(const std::vector<std::string>& arguments) {
    std::vector<std::string> with_json = arguments;
    with_json.emplace_back("--json");
    const Finished finished = cluster_.weft(with_json);
    EXPECT_EQ(finished.code, 0) << finished.err;
    return finished.code == 0 ? finished.json() : nlohmann::json();
  }
  // What light by orders of scattering takes in a database.
  std::uint64_t bytes_of_orders(const std::string& database) {
    std::uint64_t bytes = 0;
    const nlohmann::json about = run_weft(folder_, {"inspect", database, "--json"}).json();
    for (const nlohmann::json& dataset : about.at("datasets")) {
      const std::string path = dataset.at("path");
      bytes += path.starts_with("/iirtf/order_") ? dataset.at("bytes").get<std::uint64_t>() : 0;
    }
    return bytes;
  }
  [[nodiscard]] std::uint64_t bytes_in(const std::string& name) const {
    std::uint64_t bytes = 0;
    for (const auto& item : std::filesystem::recursive_directory_iterator(
             std::filesystem::path(folder_ / "versions-state") / name)) {
      bytes += item.is_regular_file() ? item.file_size() : 0;
    }
    return bytes;
  }

  TestFolder folder_;
  TestCluster cluster_{folder_, "versions", 1};
};

TEST_F(Versions, TenColoursShareTheirVisibilityOnTheDiskAndOnTheWire) {
  const std::set<std::string> of_light{"transfer", "shadow"};
  for (int i = 0; i < kColours; ++i) {
    const nlohmann::json job = submit(i);
    for (const nlohmann::json& stage : job.at("stages")) {
      const std::uint64_t cached = stage.at("shards_cached");
      const std::uint64_t shards = stage.at("shards");
      const bool is_new = i == 0 || of_light.contains(stage.at("name"));
      EXPECT_EQ(cached, is_new ? 0 : shards) << i << " " << stage.at("name");
    }
    EXPECT_EQ(job.at("version").at("parent"), i);
    EXPECT_EQ(job.at("cached_bytes") == 0, i == 0);
  }

  const nlohmann::json versions = json({"versions", "tiny"});
  ASSERT_EQ(versions.size(), std::size_t{kColours});
  std::uint64_t new_bytes = 0;
  std::uint64_t all_bytes = 0;
  for (const nlohmann::json& version : versions) {
    const std::uint64_t size = version.at("size_bytes");
    const std::uint64_t shared = version.at("shared_bytes");
    all_bytes += size;
    new_bytes += size - shared;
    const bool is_first = version.at("number") == 1;
    EXPECT_EQ(shared == 0, is_first);
  }
  EXPECT_EQ(bytes_in("pieces"), new_bytes);
  EXPECT_EQ(bytes_in("versions"), 0U);
  EXPECT_LT(new_bytes * 100, all_bytes * 60);

  // With the ninth here, the tenth's rest comes over the wire, and is the same file.
  const std::string output = folder_ / "out.h5";
  ASSERT_EQ(json({"fetch", "tiny@9", "-o", output}).at("bytes_reused"), 0U);
  const nlohmann::json tenth = json({"fetch", "tiny@10", "-o", output});
  const std::uint64_t size = tenth.at("version").at("size_bytes");
  const std::uint64_t fetched = tenth.at("bytes_fetched");
  EXPECT_EQ(fetched + tenth.at("bytes_reused").get<std::uint64_t>(), size);
  // Light by orders of scattering is what a colour has of its own, as its transfer is; the bounds
  // are those of the rest.
  const std::uint64_t orders = bytes_of_orders(output);
  EXPECT_GT(orders, 0U);
  EXPECT_LT((fetched - orders) * 100, (size - orders) * 55);
  for (const nlohmann::json& version : versions) {
    const std::uint64_t rest = version.at("size_bytes").get<std::uint64_t>() - orders;
    const std::uint64_t shared = version.at("shared_bytes");
    EXPECT_TRUE(version.at("number") == 1 || shared * 100 > rest * 45) << shared << " of " << rest;
  }
  const std::string whole = folder_ / "whole.h5";
  ASSERT_EQ(json({"fetch", "tiny@10", "-o", whole}).at("bytes_fetched"), size);
  EXPECT_EQ(core::read_file(whole), core::read_file(output));
  EXPECT_EQ(run_weft(folder_, {"verify", output}).code, 0);
  const Finished words = cluster_.weft({"fetch", "tiny@8", "-o", output});
  EXPECT_NE(words.out.find("the rest was here"), std::string::npos) << words.out;
  RecordProperty("tenth_fetched_bytes", std::to_string(fetched));
}

TEST_F(Versions, AreTaggedComparedRolledBackAndRemembered) {
  submit(0);
  submit(1);
  const nlohmann::json diff = json({"diff", "tiny@1", "tiny@2"});
  std::set<std::string> fields;
  for (const nlohmann::json& field : diff.at("fields")) {
    fields.insert(field.at("path"));
  }
  EXPECT_EQ(fields, std::set<std::string>{"materials[0].c_tt.r"});
  std::set<std::string> different;
  for (const nlohmann::json& dataset : diff.at("datasets")) {
    if (!dataset.at("equal")) {
      different.insert(dataset.at("path"));
    }
  }
  EXPECT_TRUE(different.contains("/iirtf/transfer"));
  EXPECT_TRUE(different.contains("/materials/c_tt"));
  EXPECT_FALSE(different.contains("/visibility/ssdf/basis"));
  EXPECT_FALSE(different.contains("/exemplar/points_mm"));
  const Finished words = cluster_.weft({"diff", "tiny@1", "tiny@2"});
  EXPECT_NE(words.out.find("materials[0].c_tt.r: 0.15 -> 0.23"), std::string::npos) << words.out;
  const std::string all = std::to_string(diff.at("datasets").size());
  const Finished same = cluster_.weft({"diff", "tiny@1", "tiny@1"});
  EXPECT_NE(same.out.find(all + " of " + all), std::string::npos) << same.out;

  EXPECT_EQ(json({"tag", "tiny@1", "approved"}).at("tags").at(0), "approved");
  EXPECT_EQ(json({"fetch", "tiny:approved", "-o", folder_ / "a.h5"}).at("version").at("number"), 1);
  EXPECT_EQ(json({"rollback", "tiny:approved", "--comment", "too blue"}).at("number"), 1);
  EXPECT_EQ(json({"fetch", "tiny", "-o", folder_ / "b.h5"}).at("version").at("number"), 1);
  const Finished listed = cluster_.weft({"versions", "tiny"});
  EXPECT_NE(listed.out.find("latest,approved"), std::string::npos) << listed.out;
  EXPECT_EQ(submit(2).at("version").at("parent"), 1);
  EXPECT_EQ(json({"untag", "tiny:approved"}).at("tags").size(), 0U);
  const nlohmann::json log = json({"log", "tiny"});
  std::vector<std::string> actions;
  for (const nlohmann::json& entry : log) {
    actions.push_back(entry.at("action").get<std::string>() + " " +
                      std::to_string(entry.at("number").get<int>()));
  }
  EXPECT_EQ(actions, (std::vector<std::string>{"untagged 1", "published 3", "rolled_back 1",
                                               "tagged 1", "published 2", "published 1"}));
  EXPECT_NE(cluster_.weft({"log", "tiny"}).out.find("too blue"), std::string::npos);

  const nlohmann::json gone = json({"gc", "--dry-run"});
  EXPECT_EQ(gone.at("blobs_removed"), 0U);
  EXPECT_GT(gone.at("blobs_kept"), 10U);
  EXPECT_NE(cluster_.weft({"gc"}).out.find("0 blobs (0 B) moved to the trash"), std::string::npos);
}

TEST_F(Versions, WrongOrdersSayWhatThereIs) {
  submit(0);
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& part) {
    const Finished finished = cluster_.weft(arguments);
    EXPECT_EQ(finished.code, code) << arguments[0] << finished.err;
    EXPECT_NE(finished.err.find(part), std::string::npos) << finished.err;
  };
  refused({"tag", "tiny@7", "approved"}, 3, "its latest is 1");
  refused({"tag", "tiny@1", "Approved"}, 2, "is no tag");
  refused({"tag", "tiny@1", "latest"}, 2, "is no tag");
  refused({"untag", "tiny:never"}, 3, "it has no tags");
  refused({"untag", "tiny@1"}, 2, "names no tag");
  refused({"rollback", "tiny"}, 2, "is the latest already");
  refused({"rollback", "silk@1"}, 3, "published are: tiny");
  refused({"diff", "tiny", "tiny@2"}, 3, "its latest is 1");
  refused({"log", "silk"}, 3, "published are: tiny");
  refused({"gc", "--grace", "5s"}, 2, "--grace");
  refused({"fetch", "tiny:never", "-o", folder_ / "x.h5"}, 3, "no tag");
}

}  // namespace
}  // namespace weft::cli
