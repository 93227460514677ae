#include <algorithm>
#include <csignal>
#include <fstream>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "coordinator/journal/journal.h"
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
    for (const std::optional<KeptResult>& found : journal.results_of(works)) {
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
  for (int i = 0; i < 20; ++i) {
    journal.append({result(i)});
    ASSERT_EQ(journal.results_of(std::vector{result(i).shard})[0]->result, result(i).result);
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

TEST_F(JournalTest, EveryKindOfRecord_IsThereAfterReopening) {
  JobRecord demanding = job("a");
  demanding.demands = {"anna", -7, 0.25, {"gpu", "rack=3"}};
  const core::Digest other = core::digest_of("other");
  {
    Journal journal(file());
    journal.append({demanding, job("b"), result(1), result(2), result(3)});
    journal.append({PauseRecord{"a", true}, PriorityRecord{"a", 42}, DrainRecord{"w1", true},
                    DrainRecord{"w2", true}, DrainRecord{"w1", false}, OrderRecord{"o1"},
                    OrderRecord{"o1"}, OrderRecord{"o2"}});
    journal.append({ResultDropRecord{result(2).shard, result(2).result},
                    ResultDropRecord{result(3).shard, other}, AuditRecord{result(1).shard, "w2"}});
    journal.append({FailureRecord{"b", StageName::kGrid, 1, "w1", "x", TroubleKind::kHung},
                    FailureRecord{"b", StageName::kGrid, 2, "w2", "y", TroubleKind::kLost},
                    FailuresDropRecord{"b", StageName::kGrid, "w1"},
                    BlockRecord{"w1", StageName::kGrid, true, false},
                    BlockRecord{"w1", StageName::kBasis, true, true},
                    BlockRecord{"w1", StageName::kGrid, false, false}});
    journal.append(
        {AttemptRecord{"b", 7, StageName::kGrid, 2, 3, "id1", "w1", Purpose::kAudit, 11},
         AttemptRecord{"b", 8, StageName::kGrid, 5, 1, "id2", "w2", Purpose::kFirst, 12},
         AttemptEndRecord{"b", 7, Outcome::kFailed, 1, "it burns", 13},
         MismatchRecord{"b", StageName::kGrid, 2, "w1", other, "w2", result(1).result, ""},
         MismatchRecord{"b", StageName::kGrid, 2, "w1", other, "w2", result(1).result, "w1"}});
  }
  Journal journal(file());
  const JobRecord a = *journal.job("a");
  EXPECT_EQ(a.demands.user, "anna");
  EXPECT_EQ(a.demands.priority, 42);
  EXPECT_EQ(a.demands.audit, 0.25);
  EXPECT_EQ(a.demands.labels, (std::vector<std::string>{"gpu", "rack=3"}));
  EXPECT_TRUE(a.is_paused);
  EXPECT_EQ(journal.drained(), std::vector<std::string>{"w2"});
  EXPECT_EQ(journal.orders(), (std::vector<std::string>{"o1", "o2"}));
  EXPECT_EQ(known_results(journal, 5), 2);
  EXPECT_TRUE(journal.results_of(std::vector{result(1).shard})[0]->is_audited);
  EXPECT_FALSE(journal.results_of(std::vector{result(3).shard})[0]->is_audited);
  const std::vector<FailureRecord> failures = journal.failures_of("b", StageName::kGrid);
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_EQ(failures[0].kind, TroubleKind::kLost);
  ASSERT_EQ(journal.blocks().size(), 1U);
  EXPECT_EQ(journal.blocks()[0].stage, StageName::kBasis);
  EXPECT_TRUE(journal.blocks()[0].is_liar);
  const std::vector<AttemptRecord> running = journal.running_attempts("b", StageName::kGrid);
  ASSERT_EQ(running.size(), 1U);
  EXPECT_EQ(running[0].worker, "id2");
  const std::vector<KeptAttempt> all =
      journal.attempts_of("b", 10, [](const AttemptRecord&) { return true; });
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[1].end->message, "it burns");
  EXPECT_EQ(all[1].begin.purpose, Purpose::kAudit);
  EXPECT_FALSE(all[0].end.has_value());
  ASSERT_EQ(journal.mismatches_of("b").size(), 1U);
  EXPECT_EQ(journal.mismatches_of("b")[0].liar, "w1");
}

TEST_F(JournalTest, EndedJob_HasNoFailuresAndNoRunningAttempts_AndCanBeRetried) {
  Journal journal(file());
  journal.append({job("a"), FailureRecord{"a", StageName::kGrid, 1, "w", "x", {}},
                  AttemptRecord{"a", 1, StageName::kGrid, 0, 1, "i", "w", Purpose::kFirst, 5},
                  MismatchRecord{"a", StageName::kGrid, 1, "w", {}, "w2", {}, ""},
                  JobEndRecord{"a", 99, "summary"}});
  EXPECT_TRUE(journal.failures_of("a", StageName::kGrid).empty());
  EXPECT_TRUE(journal.running_attempts("a", StageName::kGrid).empty());
  EXPECT_EQ(journal.mismatches_of("a").size(), 1U);
  journal.append({RetryRecord{"a"}});
  EXPECT_TRUE(journal.mismatches_of("a").empty());
  const JobRecord again = *journal.job("a");
  EXPECT_EQ(again.ended_at_ms, 0);
  EXPECT_EQ(again.summary, "");
  EXPECT_EQ(again.retries, 1U);
  EXPECT_EQ(journal.jobs(0).size(), 1U);
}

TEST_F(JournalTest, AttemptThatIsTakenUpAgain_KeepsHowItHadEnded) {
  Journal journal(file());
  const AttemptRecord begun{"a", 1, StageName::kGrid, 0, 1, "i", "w", Purpose::kFirst, 5};
  AttemptRecord again = begun;
  again.began_at_ms = 70;
  journal.append(
      {job("a"), begun, AttemptEndRecord{"a", 1, Outcome::kLost, 0, "silent", 40}, again});
  const auto any = [](const AttemptRecord&) { return true; };
  KeptAttempt kept = journal.attempts_of("a", 10, any).at(0);
  EXPECT_FALSE(kept.end.has_value());
  EXPECT_EQ(kept.begin.began_at_ms, 5);
  EXPECT_EQ(kept.taken_up, 1U);
  EXPECT_EQ(kept.taken_up_at_ms, 70);
  EXPECT_EQ(kept.earlier_outcome, Outcome::kLost);
  EXPECT_EQ(kept.earlier_ended_at_ms, 40);
  EXPECT_EQ(journal.running_attempts("a", StageName::kGrid).size(), 1U);
  again.began_at_ms = 90;  // said again though it runs: nothing has happened to it
  journal.append({again});
  EXPECT_EQ(journal.attempts_of("a", 10, any).at(0).taken_up, 1U);
  journal.append({AttemptEndRecord{"a", 1, Outcome::kSucceeded, 1, "", 100}});
  kept = journal.attempts_of("a", 10, any).at(0);
  ASSERT_TRUE(kept.end.has_value());
  EXPECT_EQ(kept.end->outcome, Outcome::kSucceeded);
  EXPECT_EQ(kept.earlier_outcome, Outcome::kLost);
  EXPECT_EQ(kept.earlier_ended_at_ms, 40);
}

TEST_F(JournalTest, EndedAttempts_AreKeptUpToALimit) {
  const std::uint64_t count = 2 * kEndedAttemptsLimit;
  const auto any = [](const AttemptRecord&) { return true; };
  {
    Journal journal(file());
    std::vector<Record> records{job("a")};
    for (std::uint64_t i = 1; i <= count; ++i) {
      records.emplace_back(AttemptRecord{"a", i, StageName::kGrid, i, 1, "i", "w", {}, 5});
      if (i != 3) {
        records.emplace_back(AttemptEndRecord{"a", i, Outcome::kSucceeded, 1, "", 6});
      }
    }
    journal.append(std::move(records));
    EXPECT_LE(journal.attempts_of("a", count, any).size(), kEndedAttemptsLimit * 5 / 4 + 1);
  }
  Journal journal(file());
  const std::vector<KeptAttempt> kept = journal.attempts_of("a", count, any);
  EXPECT_GE(kept.size(), kEndedAttemptsLimit);
  EXPECT_EQ(kept.front().begin.attempt, count);
  EXPECT_EQ(kept.back().begin.attempt, 3U);  // it still runs
}

TEST_F(JournalTest, EndedJobs_AreKeptUpToALimit) {
  Journal journal(file());
  std::vector<Record> records;
  const std::uint64_t count = kAttemptJobsLimit + 64;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string id = std::string("j").append(std::to_string(i));
    records.emplace_back(job(id));
    records.emplace_back(AttemptRecord{id, 1, StageName::kGrid, 0, 1, "i", "w", {}, 5});
    records.emplace_back(JobEndRecord{id, static_cast<std::int64_t>(i + 1), "s"});
  }
  journal.append(std::move(records));
  const auto attempts_of = [&](const std::string& id) {
    return journal.attempts_of(id, 9, [](const AttemptRecord&) { return true; }).size();
  };
  EXPECT_EQ(journal.jobs(2 * count).size(), count);
  EXPECT_EQ(attempts_of("j0"), 0U);
  EXPECT_EQ(attempts_of(std::string("j").append(std::to_string(count - 1))), 1U);
}

TEST_F(JournalTest, Answers_ComeInOrderAndNotBeforeTheDisk) {
  std::mutex mutex;
  std::vector<int> answered;
  {
    Journal journal(file());
    for (int i = 0; i < 50; ++i) {
      const Journal::Ticket ticket = journal.append({result(i)});
      journal.when_durable(ticket, [&, i](const std::optional<core::Error>& problem) {
        EXPECT_FALSE(problem.has_value());
        const std::lock_guard lock(mutex);
        answered.push_back(i);
      });
    }
  }
  ASSERT_EQ(answered.size(), 50U);
  // One that finds its ticket durable already is answered at once, ahead of nobody's later ticket.
  EXPECT_TRUE(std::is_sorted(answered.begin(), answered.end()));
}

// A file as the program of schema 1 left it, with a row in each table.
constexpr const char* kSchema1 = R"sql(
CREATE TABLE meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO meta VALUES('schema', 1), ('epoch', 41);
CREATE TABLE jobs(
  position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE,
  request_id TEXT NOT NULL UNIQUE, fabric TEXT NOT NULL, description BLOB NOT NULL,
  comment TEXT NOT NULL, fingerprint BLOB, submitted_at_ms INTEGER NOT NULL,
  ended_at_ms INTEGER NOT NULL, summary BLOB NOT NULL);
INSERT INTO jobs VALUES(1, 'a', 'ra', 'silk', x'0102', 'c', NULL, 17, 0, x'');
CREATE TABLE results(
  shard BLOB PRIMARY KEY, result BLOB NOT NULL, size_bytes INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX results_by_result ON results(result);
INSERT INTO results VALUES(zeroblob(32), zeroblob(32), 5);
CREATE TABLE failures(
  job TEXT NOT NULL, stage INTEGER NOT NULL, shard INTEGER NOT NULL, worker TEXT NOT NULL,
  message TEXT NOT NULL);
CREATE INDEX failures_by_job ON failures(job, stage);
INSERT INTO failures VALUES('a', 3, 4, 'w', 'it burns');
CREATE TABLE versions(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, content_digest BLOB NOT NULL,
  size_bytes INTEGER NOT NULL, file TEXT NOT NULL, job TEXT NOT NULL, comment TEXT NOT NULL,
  published_at_ms INTEGER NOT NULL, PRIMARY KEY(fabric, number)) WITHOUT ROWID;
INSERT INTO versions VALUES('silk', 1, zeroblob(32), 5, 'silk-1.h5', 'a', 'c', 99);
)sql";

TEST_F(JournalTest, FileOfSchema1_IsBroughtUpToDate) {
  Connection(file()).run(kSchema1);
  {
    Journal journal(file());
    EXPECT_EQ(journal.epoch(), 42U);
    const JobRecord a = *journal.job("a");
    EXPECT_EQ(a.demands.user, "nobody");
    EXPECT_FALSE(a.is_paused);
    EXPECT_EQ(journal.failures_of("a", StageName::kBasis).size(), 1U);
    EXPECT_EQ(journal.results_of(std::vector{core::Digest{}})[0]->worker, "");
    EXPECT_EQ(journal.catalogue().versions("silk").size(), 1U);
    journal.append({PauseRecord{"a", true}, result(1)});
  }
  Journal journal(file());
  EXPECT_TRUE(journal.job("a")->is_paused);
  EXPECT_EQ(known_results(journal, 3), 1);
}

TEST_F(JournalTest, FileOfSchema2_IsBroughtUpToDate) {
  {
    Journal journal(file());
    journal.append({job("a"),
                    AttemptRecord{"a", 1, StageName::kGrid, 0, 1, "i", "w", Purpose::kFirst, 5},
                    AttemptEndRecord{"a", 1, Outcome::kLost, 0, "silent", 40}});
    journal.wait(journal.append({}));
  }
  for (const char* column :
       {"taken_up", "taken_up_at_ms", "earlier_outcome", "earlier_ended_at_ms"}) {
    Connection(file()).run((std::string("ALTER TABLE attempts DROP COLUMN ") + column).c_str());
  }
  Connection(file()).run("UPDATE meta SET value = 2 WHERE key = 'schema'");
  Journal journal(file());
  const KeptAttempt kept =
      journal.attempts_of("a", 10, [](const AttemptRecord&) { return true; }).at(0);
  EXPECT_EQ(kept.end->outcome, Outcome::kLost);
  EXPECT_EQ(kept.taken_up, 0U);
}

TEST_F(JournalTest, FileOfANewerSchema_IsRefusedAndLeftAlone) {
  { const Journal journal(file()); }
  Connection(file()).run("UPDATE meta SET value = 99 WHERE key = 'schema'");
  try {
    const Journal journal(file());
    FAIL() << "nothing was thrown";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kFailedPrecondition);
    EXPECT_NE(std::string(error.what()).find("schema 99"), std::string::npos);
  }
}

TEST_F(JournalTest, FileThatDoesNotCountItsStarts_IsDamaged) {
  for (const char* const epoch : {"-1", "4294967295"}) {
    { const Journal journal(file()); }
    const std::string set =
        "UPDATE meta SET value = " + std::string(epoch) + " WHERE key = 'epoch'";
    Connection(file()).run(set.c_str());
    try {
      const Journal journal(file());
      FAIL() << epoch << ": nothing was thrown";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss) << epoch;
    }
    Connection(file()).run("UPDATE meta SET value = 1 WHERE key = 'epoch'");
  }
}

}  // namespace
}  // namespace weft::coordinator
