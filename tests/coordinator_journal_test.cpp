#include <csignal>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "coordinator/catalogue.h"
#include "coordinator/journal.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::coordinator {
namespace {

class JournalTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "weft_journal_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path file() const { return folder_ / "journal.db"; }

  static ResultRecord result(int number) {
    return {core::digest_of(std::string("work ").append(std::to_string(number))),
            core::digest_of(std::string("result ").append(std::to_string(number))),
            5,
            {}};
  }
  static JobRecord job(const std::string& id) {
    JobRecord record;
    record.id = id;
    record.request_id = "request-" + id;
    record.fabric = "silk";
    record.description = std::string("bytes \0 and more", 16);
    record.submitted_at_ms = 17;
    return record;
  }
  static int known_results(Journal& journal, int count) {
    std::vector<core::Digest> works;
    for (int i = 0; i < count; ++i) {
      works.push_back(result(i).shard);
    }
    int known = 0;
    for (const std::optional<core::Digest>& found : journal.results_of(works)) {
      known += found ? 1 : 0;
    }
    return known;
  }
  // Runs `body` in a process of its own and returns how that ended.
  template <class Body>
  static int in_child(Body body) {
    const pid_t child = ::fork();
    if (child == 0) {
      body();
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return status;
  }

  std::filesystem::path folder_;
};

TEST_F(JournalTest, Records_AreThereAfterReopening) {
  {
    Journal journal(file());
    EXPECT_EQ(journal.epoch(), 1U);
    journal.append({job("a"), job("b"), result(1)});
    journal.append(
        {BindRecord{"b", core::digest_of("fingerprint")},
         FailureRecord{"b", StageName::kBasis, 3, "w", "it burns", TroubleKind::kFailed}});
    journal.wait(journal.append({JobEndRecord{"a", 99, "summary"}}));
  }
  Journal journal(file());
  EXPECT_EQ(journal.epoch(), 2U);
  const std::vector<JobRecord> jobs = journal.jobs(10);
  ASSERT_EQ(jobs.size(), 2U);
  EXPECT_EQ(jobs[0].id, "b");  // unfinished ones first
  EXPECT_EQ(jobs[0].description, job("b").description);
  EXPECT_EQ(jobs[0].fingerprint, core::digest_of("fingerprint"));
  EXPECT_EQ(jobs[1].id, "a");
  EXPECT_EQ(jobs[1].summary, "summary");
  EXPECT_EQ(jobs[1].ended_at_ms, 99);
  EXPECT_EQ(journal.job_of_request("request-a")->id, "a");
  EXPECT_FALSE(journal.job_of_request("request-c").has_value());
  const std::vector<FailureRecord> failures = journal.failures_of("b", StageName::kBasis);
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_EQ(failures[0].shard, 3U);
  EXPECT_EQ(failures[0].message, "it burns");
  EXPECT_TRUE(journal.failures_of("b", StageName::kGrid).empty());
  EXPECT_EQ(known_results(journal, 3), 1);
}

TEST_F(JournalTest, KilledProcess_LosesNothingThatWasAcknowledged) {
  const int status = in_child([&] {
    Journal journal(file());
    for (int i = 0; i < 50; ++i) {
      journal.wait(journal.append({result(i)}));
    }
    ::kill(::getpid(), SIGKILL);
  });
  ASSERT_TRUE(WIFSIGNALED(status));
  Journal journal(file());
  EXPECT_EQ(known_results(journal, 60), 50);
}

TEST_F(JournalTest, Lookup_SeesWhatIsNotWrittenYet) {
  Journal journal(file());
  for (int i = 0; i < 200; ++i) {
    journal.append({result(i)});
    ASSERT_EQ(journal.results_of(std::vector{result(i).shard})[0], result(i).result);
  }
}

TEST_F(JournalTest, ManyThreads_CommitTogether) {
  {
    Journal journal(file());
    std::vector<std::thread> threads;
    for (int t = 0; t < 8; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 25; ++i) {
          journal.wait(journal.append({result(t * 25 + i)}));
        }
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
  }
  Journal journal(file());
  EXPECT_EQ(known_results(journal, 200), 200);
}

TEST_F(JournalTest, SecondJournalOnTheFile_IsRefused) {
  const Journal first(file());
  try {
    const Journal second(file());
    FAIL() << "nothing was thrown";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kFailedPrecondition);
    EXPECT_NE(std::string(error.what()).find("another coordinator"), std::string::npos);
  }
}

TEST_F(JournalTest, FileOfSomethingElse_IsRefused) {
  std::ofstream(file()) << std::string(10'000, 'x');
  EXPECT_THROW(Journal{file()}, core::Error);
}

TEST_F(JournalTest, AfterAFailedWriteNothingIsPromisedAnyMore) {
  const int status = in_child([&] {
    Journal journal(file());
    journal.wait(journal.append({result(0)}));
    const auto size = static_cast<rlim_t>(std::filesystem::file_size(file().string() + "-wal"));
    const rlimit limit{size, size};
    ::signal(SIGXFSZ, SIG_IGN);
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int refusals = 0;
    try {
      std::vector<Record> many;
      for (int i = 1; i < 5000; ++i) {
        many.emplace_back(result(i));
      }
      journal.wait(journal.append(std::move(many)));
    } catch (const core::Error& error) {
      refusals += error.code() == core::Code::kUnavailable ? 1 : 0;
    }
    try {
      journal.append({result(1)});
    } catch (const core::Error& error) {
      refusals += error.code() == core::Code::kUnavailable ? 1 : 0;
    }
    ::_exit(refusals);
  });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 2);
  Journal journal(file());
  EXPECT_EQ(known_results(journal, 5000), 1);
}

TEST_F(JournalTest, ForgottenResult_IsUnknownForAllItsShards) {
  Journal journal(file());
  ResultRecord same = result(2);
  same.result = result(1).result;
  journal.append({result(1), same, result(3)});
  EXPECT_EQ(journal.forget_result(result(1).result), 2U);
  EXPECT_EQ(journal.forget_result(result(1).result), 0U);
  EXPECT_EQ(known_results(journal, 4), 1);
}

class CatalogueTest : public JournalTest {
 protected:
  Publication publication(const std::string& fabric, const std::string& content) {
    const std::filesystem::path path = folder_ / "made.h5";
    core::write_file_atomically(path, content);
    return {fabric, core::digest_of(content), path, "j1", "a comment", 5};
  }
};

TEST_F(CatalogueTest, Versions_AreNumberedAndKept) {
  {
    Journal journal(file());
    Catalogue catalogue(journal, folder_ / "versions");
    EXPECT_EQ(catalogue.publish(publication("silk", "one")).number, 1U);
    EXPECT_EQ(catalogue.publish(publication("silk", "two")).number, 2U);
    EXPECT_EQ(catalogue.publish(publication("wool", "one")).number, 1U);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "made.h5"));
  }
  Journal journal(file());
  const Catalogue catalogue(journal, folder_ / "versions");
  EXPECT_EQ(catalogue.find("silk").number, 2U);
  EXPECT_EQ(catalogue.find("silk@latest").number, 2U);
  const VersionRecord first = catalogue.find("silk@1");
  EXPECT_EQ(first.comment, "a comment");
  EXPECT_EQ(core::read_file(catalogue.path_of(first)), "one");
  EXPECT_EQ(first.file, "silk-1-" + core::digest_of("one").hex().substr(0, 12) + ".h5");
  EXPECT_EQ(catalogue.latest_versions().size(), 2U);
  EXPECT_EQ(catalogue.versions("silk").size(), 2U);
}

TEST_F(CatalogueTest, EqualContentAsTheLatest_IsTheLatestVersion) {
  Journal journal(file());
  Catalogue catalogue(journal, folder_ / "versions");
  catalogue.publish(publication("silk", "one"));
  EXPECT_EQ(catalogue.publish(publication("silk", "one")).number, 1U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "made.h5"));
  catalogue.publish(publication("silk", "two"));
  EXPECT_EQ(catalogue.publish(publication("silk", "one")).number, 3U);
}

TEST_F(CatalogueTest, WrongReferences_SayWhatThereIs) {
  Journal journal(file());
  Catalogue catalogue(journal, folder_ / "versions");
  catalogue.publish(publication("silk", "one"));
  const auto code_of = [&](const std::string& reference, const std::string& part) {
    try {
      (void)catalogue.find(reference);
    } catch (const core::Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      return error.code();
    }
    return core::Code::kInternal;
  };
  EXPECT_EQ(code_of("wool", "published are: silk"), core::Code::kNotFound);
  EXPECT_EQ(code_of("silk@2", "its latest is 1"), core::Code::kNotFound);
  EXPECT_EQ(code_of("silk@", "NAME@NUMBER"), core::Code::kInvalidArgument);
  EXPECT_EQ(code_of("silk@1x", "NAME@NUMBER"), core::Code::kInvalidArgument);
  EXPECT_EQ(code_of("../silk", "NAME@NUMBER"), core::Code::kInvalidArgument);
  EXPECT_EQ(code_of("", "NAME@NUMBER"), core::Code::kInvalidArgument);
  EXPECT_THROW(catalogue.publish(publication("../silk", "one")), core::Error);
}

}  // namespace
}  // namespace weft::coordinator
