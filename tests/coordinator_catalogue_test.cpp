#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "coordinator/versions/catalogue.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::coordinator {
namespace {

class CatalogueTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    open();
  }
  void TearDown() override {
    catalogue_.reset();
    journal_.reset();
    std::filesystem::remove_all(folder_);
  }
  // As a coordinator that starts (again).
  void open() {
    catalogue_.reset();
    journal_.reset();
    journal_ = std::make_unique<Journal>(folder_ / "journal.db");
    catalogue_ = std::make_unique<Catalogue>(*journal_, folder_);
  }

  static std::string content_of(const std::string& word) {
    std::string content;
    for (int i = 0; content.size() < 700'000; ++i) {
      content += core::digest_of(word + std::to_string(i)).binary();
    }
    return content;
  }
  Publication publication(const std::string& fabric, const std::string& content,
                          const std::string& job = "j1") {
    Publication made;
    made.fabric = fabric;
    made.content_digest = core::digest_of(content);
    made.file = folder_ / "made.h5";
    made.job = job;
    made.comment = "a comment";
    made.now_ms = 5;
    made.user = "ada";
    made.cached_shards = 3;
    made.computed_shards = 4;
    made.results = {core::digest_of("result of " + content)};
    core::write_file_atomically(made.file, content);
    return made;
  }
  VersionRecord publish(const std::string& fabric, const std::string& content,
                        const std::string& job) {
    Publication made = publication(fabric, content, job);
    catalogue_->prepare(made);
    return catalogue_->publish(made);
  }
  std::string read(const VersionRecord& version, std::uint64_t offset = 0) {
    std::string content;
    catalogue_->read(version, offset, [&](std::string_view bytes) {
      content += bytes;
      return true;
    });
    return content;
  }
  static CatalogueOrder order(const std::string& request_id) {
    return {request_id, "ada", "why", 7};
  }
  template <class Function>
  static core::Code code_of(Function function, const std::string& part) {
    try {
      function();
    } catch (const core::Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      return error.code();
    }
    return core::Code::kInternal;
  }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_catalogue_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
  std::unique_ptr<Journal> journal_;
  std::unique_ptr<Catalogue> catalogue_;
};

TEST_F(CatalogueTest, Versions_AreNumberedAndKept) {
  const std::string one = content_of("one");
  EXPECT_EQ(publish("silk", one, "j1").number, 1U);
  EXPECT_EQ(publish("silk", content_of("two"), "j2").number, 2U);
  EXPECT_EQ(publish("wool", one, "j3").number, 1U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "made.h5"));
  open();
  EXPECT_EQ(catalogue_->find("silk").number, 2U);
  EXPECT_EQ(catalogue_->find("silk").parent, 1U);
  EXPECT_EQ(catalogue_->find("silk@latest").number, 2U);
  const VersionRecord first = catalogue_->find("silk@1");
  EXPECT_EQ(first.comment, "a comment");
  EXPECT_EQ(first.user, "ada");
  EXPECT_EQ(first.cached_shards, 3U);
  EXPECT_EQ(first.computed_shards, 4U);
  EXPECT_EQ(first.size_bytes, one.size());
  EXPECT_EQ(first.file, "silk-1-" + core::digest_of(one).hex().substr(0, 12) + ".h5");
  EXPECT_EQ(read(first), one);
  EXPECT_EQ(read(first, 300'001), one.substr(300'001));
  EXPECT_EQ(read(first, one.size()), "");
  EXPECT_EQ(catalogue_->latest_versions().size(), 2U);
  EXPECT_EQ(catalogue_->versions("silk").size(), 2U);
  EXPECT_EQ(catalogue_->published_results().size(), 2U);
  EXPECT_EQ(catalogue_->find("wool").shared_bytes, one.size());
  EXPECT_EQ(first.shared_bytes, 0U);
}

TEST_F(CatalogueTest, EqualContentAsTheLatest_IsTheLatestVersion) {
  const std::string one = content_of("one");
  publish("silk", one, "j1");
  EXPECT_EQ(publish("silk", one, "j2").number, 1U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "made.h5"));
  publish("silk", content_of("two"), "j3");
  EXPECT_EQ(publish("silk", one, "j4").number, 3U);
  publish("silk", content_of("three"), "j5");
  EXPECT_EQ(publish("silk", one, "j1").number, 1U) << "a job that published before";
}

TEST_F(CatalogueTest, VersionsThatShareBytes_AreStoredOnce) {
  const std::string one = content_of("one");
  std::string other = one;
  other.replace(0, 9, "a new one");
  publish("silk", one, "j1");
  const VersionRecord second = publish("silk", other, "j2");
  EXPECT_GT(second.shared_bytes, one.size() / 2);
  std::uint64_t stored = 0;
  catalogue_->pieces().visit(
      [&](const storage::BlobStore::Entry& entry) { stored += entry.size_bytes; });
  EXPECT_EQ(stored, one.size() + other.size() - second.shared_bytes);
  EXPECT_EQ(read(second), other);
  EXPECT_EQ(read(catalogue_->find("silk@1")), one);
}

TEST_F(CatalogueTest, Tags_NameOneVersionAndMove) {
  publish("silk", content_of("one"), "j1");
  publish("silk", content_of("two"), "j2");
  EXPECT_EQ(catalogue_->tag("silk@1", "approved", order("r1")).tags,
            std::vector<std::string>{"approved"});
  EXPECT_EQ(catalogue_->find("silk:approved").number, 1U);
  catalogue_->tag("silk@1", "a-first.one", order("r2"));
  EXPECT_EQ(catalogue_->find("silk@1").tags, (std::vector<std::string>{"a-first.one", "approved"}));
  catalogue_->tag("silk", "approved", order("r3"));
  EXPECT_EQ(catalogue_->find("silk:approved").number, 2U);
  EXPECT_EQ(catalogue_->tag("silk@1", "approved", order("r3")).number, 2U) << "a repeated call";
  EXPECT_EQ(catalogue_->find("silk:approved").number, 2U);
  open();
  EXPECT_EQ(catalogue_->untag("silk", "approved", order("r4")).number, 2U);
  EXPECT_EQ(catalogue_->untag("silk", "approved", order("r4")).number, 2U) << "a repeated call";
  EXPECT_EQ(code_of([&] { (void)catalogue_->find("silk:approved"); }, "its tags are: a-first.one"),
            core::Code::kNotFound);
  EXPECT_EQ(code_of([&] { catalogue_->untag("silk", "approved", order("r5")); }, "no tag"),
            core::Code::kNotFound);
  for (const char* wrong : {"", "latest", "12", "Big", "-x", "a/b", "a b", ".."}) {
    EXPECT_EQ(code_of([&] { catalogue_->tag("silk", wrong, order("r6")); }, "is no tag"),
              core::Code::kInvalidArgument)
        << wrong;
  }
}

TEST_F(CatalogueTest, RollingBack_MakesAnOlderVersionTheLatestUntilTheNext) {
  publish("silk", content_of("one"), "j1");
  publish("silk", content_of("two"), "j2");
  EXPECT_EQ(catalogue_->roll_back("silk@1", order("r1")).number, 1U);
  EXPECT_EQ(catalogue_->find("silk").number, 1U);
  open();
  EXPECT_EQ(catalogue_->find("silk@latest").number, 1U);
  EXPECT_EQ(catalogue_->latest_versions().at(0).number, 1U);
  EXPECT_EQ(catalogue_->find("silk@2").number, 2U);
  EXPECT_EQ(catalogue_->roll_back("silk@2", order("r1")).number, 1U) << "a repeated call";
  const VersionRecord third = publish("silk", content_of("three"), "j3");
  EXPECT_EQ(third.number, 3U);
  EXPECT_EQ(third.parent, 1U);
  EXPECT_EQ(catalogue_->find("silk").number, 3U);
  std::vector<std::string> actions;
  for (const HistoryRecord& step : catalogue_->history("silk", 10)) {
    actions.push_back(step.action + " " + std::to_string(step.number));
  }
  EXPECT_EQ(actions, (std::vector<std::string>{"published 3", "rolled_back 1", "published 2",
                                               "published 1"}));
  EXPECT_EQ(catalogue_->history("silk", 2).size(), 2U);
  EXPECT_EQ(catalogue_->history("silk", 2).at(1).comment, "why");
}

TEST_F(CatalogueTest, ReaderSeesOneVersionOrTheNextWhileTheyArePublished) {
  std::vector<Publication> made;
  for (int i = 0; i < 30; ++i) {
    made.push_back(publication("silk", std::string("content ").append(std::to_string(i)),
                               std::string("j").append(std::to_string(i))));
    catalogue_->prepare(made.back());
  }
  catalogue_->publish(made[0]);
  std::atomic<bool> is_over{false};
  std::thread reader([&] {
    std::uint64_t seen = 1;
    while (!is_over) {
      const VersionRecord version = catalogue_->find("silk");
      EXPECT_GE(version.number, seen);
      EXPECT_EQ(read(version), std::string("content ").append(std::to_string(version.number - 1)));
      seen = version.number;
    }
  });
  for (std::size_t i = 1; i < made.size(); ++i) {
    EXPECT_EQ(catalogue_->publish(made[i]).number, i + 1);
  }
  is_over = true;
  reader.join();
}

TEST_F(CatalogueTest, WrongReferences_SayWhatThereIs) {
  publish("silk", content_of("one"), "j1");
  const auto find = [&](const std::string& reference, const std::string& part) {
    return code_of([&] { (void)catalogue_->find(reference); }, part);
  };
  EXPECT_EQ(find("wool", "published are: silk"), core::Code::kNotFound);
  EXPECT_EQ(find("silk@2", "its latest is 1"), core::Code::kNotFound);
  EXPECT_EQ(find("silk:good", "it has no tags"), core::Code::kNotFound);
  for (const char* wrong : {"silk@", "silk@1x", "../silk", "", "silk:", "silk:1", "silk:a@1"}) {
    EXPECT_EQ(find(wrong, "NAME@NUMBER"), core::Code::kInvalidArgument) << wrong;
  }
  EXPECT_THROW(catalogue_->publish(publication("../silk", "one")), core::Error);
}

TEST_F(CatalogueTest, DamagedPiece_IsMendedFromTheResultsOrByTheNextSubmission) {
  const std::string one = content_of("one");
  const VersionRecord version = publish("silk", one, "j1");
  const std::vector<storage::Piece> pieces = catalogue_->pieces_of(version);
  ASSERT_GT(pieces.size(), 3U);
  const auto damage = [&](std::size_t index) {
    std::ofstream(catalogue_->pieces().path_of(pieces[index].digest)) << "nothing of it";
  };
  damage(1);
  EXPECT_EQ(code_of([&] { read(version); }, "silk@1 is damaged"), core::Code::kDataLoss);
  EXPECT_EQ(code_of([&] { (void)catalogue_->read_piece(pieces[1].digest); }, "submit the fabric"),
            core::Code::kDataLoss);
  EXPECT_EQ(publish("silk", one, "j2").number, 1U);
  EXPECT_EQ(read(version), one);

  int remade = 0;
  catalogue_->set_remake([&](const VersionRecord& wanted) {
    EXPECT_EQ(wanted.content_digest, version.content_digest);
    ++remade;
    core::write_file_atomically(folder_ / "remade.h5", one);
    return std::optional(folder_ / "remade.h5");
  });
  damage(2);
  std::filesystem::remove(catalogue_->pieces().path_of(pieces[3].digest));
  EXPECT_EQ(read(version), one);
  EXPECT_EQ(remade, 1);
  damage(0);
  EXPECT_EQ(core::digest_of(catalogue_->read_piece(pieces[0].digest)), pieces[0].digest);
  EXPECT_EQ(remade, 2);
  EXPECT_EQ(code_of([&] { (void)catalogue_->read_piece(core::digest_of("x")); }, "no version"),
            core::Code::kNotFound);
}

// As weft 0.3 left it: a row, and the whole file beside it.
TEST_F(CatalogueTest, VersionOfAnOlderWeft_IsServedAndCutWhenItIsAskedFor) {
  const std::string one = content_of("one");
  publish("silk", one, "j1");
  std::string name = catalogue_->find("silk").file;
  catalogue_.reset();
  journal_.reset();
  {
    Connection connection(folder_ / "journal.db");
    connection.run(
        "DELETE FROM manifests; DELETE FROM version_facts; DELETE FROM latest; "
        "DELETE FROM history; DELETE FROM published_results;");
  }
  std::filesystem::remove_all(folder_ / "pieces");
  core::write_file_atomically(folder_ / "versions" / name, one);
  open();
  const VersionRecord version = catalogue_->find("silk@latest");
  EXPECT_EQ(version.number, 1U);
  EXPECT_EQ(read(version, 5), one.substr(5));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "versions" / name));
  EXPECT_EQ(read(catalogue_->find("silk")), one);
  EXPECT_EQ(publish("silk", content_of("two"), "j2").parent, 1U);
}

TEST_F(CatalogueTest, WholeFiles_ArePutTogetherForWhoeverReadsThem) {
  std::vector<VersionRecord> versions;
  for (int i = 0; i < 7; ++i) {
    versions.push_back(
        publish("silk", content_of(std::to_string(i)), std::string("j").append(std::to_string(i))));
  }
  for (const VersionRecord& version : versions) {
    catalogue_->with_files({version, versions[0]},
                           [&](const std::vector<std::filesystem::path>& files) {
                             ASSERT_EQ(files.size(), 2U);
                             EXPECT_EQ(core::read_file(files[0]), read(version));
                             EXPECT_EQ(core::read_file(files[1]), read(versions[0]));
                           });
  }
  const std::filesystem::directory_iterator kept(folder_ / "assembled");
  EXPECT_LE(std::distance(begin(kept), end(kept)), 5);
}

}  // namespace
}  // namespace weft::coordinator
