#include <cmath>

#include "core/error.h"
#include "tests/coordinator_service_fixture.h"

namespace weft::coordinator {
namespace {

// What people order, and that it outlives the coordinator.
class Orders : public ServiceTest {
 protected:
  void configure(SchedulerOptions& options) override {
    options.queue.user_jobs_limit = 3;
    options.journal_limit_bytes = journal_limit_bytes_;
  }

  static security::Caller anna() { return {"anna", {v1::ROLE_SUBMITTER}}; }
  static security::Caller boris() { return {"boris", {v1::ROLE_SUBMITTER}}; }
  static security::Caller admin() { return {"root", {v1::ROLE_ADMIN}}; }

  v1::SubmitRequest request(const std::string& id) {
    v1::SubmitRequest request;
    request.set_request_id(id);
    *request.mutable_description() = small_description(id);
    return request;
  }
  Order order(const v1::Job& job, const security::Caller& caller) {
    return {std::string("order-").append(std::to_string(++orders_)), job.id(), caller};
  }
  template <class Body>
  static core::Code code_of(Body body, const std::string& part) {
    try {
      body();
    } catch (const core::Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      return error.code();
    }
    ADD_FAILURE() << "nothing was thrown";
    return core::Code::kInternal;
  }
  void restart() {
    stop();
    start();
  }

  std::uint64_t journal_limit_bytes_ = std::uint64_t{1} << 30;
  int orders_ = 0;
};

TEST_F(Orders, Job_BelongsToWhoSubmittedIt) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  EXPECT_EQ(job.user(), "anna");
  const auto refused = core::Code::kPermissionDenied;
  EXPECT_EQ(code_of([&] { (void)scheduler_->pause(order(job, boris()), true); }, "anna"), refused);
  EXPECT_EQ(code_of([&] { (void)scheduler_->cancel(order(job, boris())); }, "anna"), refused);
  EXPECT_EQ(code_of([&] { (void)scheduler_->set_priority(order(job, boris()), 1); }, "anna"),
            refused);
  EXPECT_EQ(code_of([&] { (void)scheduler_->retry(order(job, boris())); }, "anna"), refused);
  EXPECT_EQ(scheduler_->set_priority(order(job, anna()), 7).priority(), 7);
  EXPECT_TRUE(scheduler_->pause(order(job, admin()), true).paused());
  v1::SubmitRequest for_another = request("r2");
  for_another.mutable_options()->set_user("anna");
  EXPECT_EQ(code_of([&] { (void)scheduler_->submit(for_another, boris()); }, "admin"), refused);
  EXPECT_EQ(scheduler_->submit(for_another, admin()).user(), "anna");
  EXPECT_EQ(scheduler_->submit(request("r3"), {"", {v1::ROLE_ADMIN}}).user(), "nobody");
}

TEST_F(Orders, MalformedDemands_AreRefused) {
  const auto code = [&](auto&& change) {
    v1::SubmitRequest wrong = request("r1");
    change(*wrong.mutable_options());
    return code_of([&] { (void)scheduler_->submit(wrong, admin()); }, "");
  };
  const auto invalid = core::Code::kInvalidArgument;
  EXPECT_EQ(code([](auto& o) { o.set_user("../anna"); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.set_user(".anna"); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.set_priority(101); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.set_audit(1.5); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.set_audit(std::nan("")); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.add_labels("two words"); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.add_labels(""); }), invalid);
  EXPECT_EQ(code([](auto& o) { o.set_comment(std::string(2000, 'x')); }), invalid);
}

TEST_F(Orders, PausedJob_GetsNoWorkerUntilItIsResumed_AcrossARestart) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  (void)scheduler_->set_priority(order(job, anna()), 42);
  (void)scheduler_->pause(order(job, anna()), true);
  restart();
  EXPECT_TRUE(this->job(job.id()).paused());
  EXPECT_EQ(this->job(job.id()).priority(), 42);
  EXPECT_EQ(this->job(job.id()).user(), "anna");
  FakeWorker worker(channel_, "w");
  worker.request().set_wait_ms(300);
  EXPECT_FALSE(worker.work());
  (void)scheduler_->pause(order(job, anna()), false);
  worker.request().set_wait_ms(10'000);
  EXPECT_TRUE(worker.work());
}

TEST_F(Orders, RepeatedOrder_ChangesNothing_AcrossARestart) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  const Order pause{"the-same", job.id(), anna()};
  EXPECT_TRUE(scheduler_->pause(pause, true).paused());
  EXPECT_FALSE(scheduler_->pause(order(job, anna()), false).paused());
  EXPECT_FALSE(scheduler_->pause(pause, true).paused());
  restart();
  EXPECT_FALSE(scheduler_->pause(pause, true).paused());
}

TEST_F(Orders, CancelledJob_CanBePutBack_ASucceededOneNot) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  const v1::Job cancelled = scheduler_->cancel(order(job, anna()));
  EXPECT_EQ(cancelled.state(), v1::JOB_STATE_CANCELLED);
  const auto failed = core::Code::kFailedPrecondition;
  EXPECT_EQ(code_of([&] { (void)scheduler_->pause(order(job, anna()), true); }, "ended"), failed);
  const v1::Job again = scheduler_->retry(order(job, anna()));
  EXPECT_EQ(again.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(again.user(), "anna");
  EXPECT_GT(again.revision(), cancelled.revision());
  restart();
  FakeWorker worker(channel_, "w");
  v1::Job now = this->job(job.id());
  for (int turn = 0; turn < 200 && now.ended_at_ms() == 0; ++turn) {
    worker.request().set_wait_ms(50);
    worker.work();
    now = this->job(job.id());
  }
  EXPECT_EQ(now.state(), v1::JOB_STATE_SUCCEEDED) << now.error();
  EXPECT_EQ(code_of([&] { (void)scheduler_->retry(order(job, anna())); }, "succeeded"), failed);
}

TEST_F(Orders, FailedJob_IsRetriedWithItsFailuresForgotten) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  std::vector<std::unique_ptr<FakeWorker>> workers;
  for (const char* id : {"a", "b", "c"}) {
    workers.push_back(std::make_unique<FakeWorker>(channel_, id));
    workers.back()->request().set_wait_ms(50);
  }
  v1::Job now = job;
  for (int turn = 0; turn < 200 && now.ended_at_ms() == 0; ++turn) {
    for (const auto& worker : workers) {
      worker->work("it burns");
    }
    now = this->job(job.id());
  }
  ASSERT_EQ(now.state(), v1::JOB_STATE_FAILED);
  v1::ListAttemptsRequest of_job;
  of_job.set_job_id(job.id());
  const std::vector<v1::AttemptInfo> failed = scheduler_->attempts(of_job);
  ASSERT_GE(failed.size(), 3U);
  EXPECT_EQ(failed[0].outcome(), "failed");
  EXPECT_EQ(failed[0].message(), "it burns");
  EXPECT_EQ(failed[0].stage(), "geometry");
  EXPECT_GT(failed[0].ended_at_ms(), 0);
  EXPECT_GT(failed[0].name().attempt(), failed[1].name().attempt());
  of_job.set_stage("grid");
  EXPECT_TRUE(scheduler_->attempts(of_job).empty());
  of_job.set_stage("nonsense");
  EXPECT_EQ(code_of([&] { (void)scheduler_->attempts(of_job); }, "geometry"),
            core::Code::kInvalidArgument);

  now = scheduler_->retry(order(job, anna()));
  EXPECT_EQ(now.state(), v1::JOB_STATE_QUEUED);
  for (int turn = 0; turn < 200 && now.ended_at_ms() == 0; ++turn) {
    for (const auto& worker : workers) {
      worker->work();
    }
    now = this->job(job.id());
  }
  EXPECT_EQ(now.state(), v1::JOB_STATE_SUCCEEDED) << now.error();
}

TEST_F(Orders, ResultsThatDiffer_AreToldAcrossARestart) {
  v1::SubmitRequest audited = request("r1");
  audited.mutable_options()->set_audit(1);
  const std::string id = scheduler_->submit(audited, anna()).id();
  FakeWorker first(channel_, "first");
  ASSERT_TRUE(first.work());
  ASSERT_EQ(first.log.at(0), "geometry 0+1");
  first.request().set_free_attempts(0);
  first.request().set_wait_ms(0);
  first.work();
  FakeWorker second(channel_, "second");
  ASSERT_TRUE(second.work());
  ASSERT_EQ(second.log.at(0), "geometry 0+1") << "the audit";
  const core::Digest lie = core::digest_of("a lie");
  v1::WriteResponse written;
  ASSERT_TRUE(write("a lie", lie, &written).ok());
  second.request().mutable_completions(0)->mutable_results(0)->set_digest(lie.binary());
  second.request().set_free_attempts(0);
  second.request().set_wait_ms(0);
  second.work();
  const v1::Job before = job(id);
  ASSERT_EQ(before.troubles_size(), 1);
  EXPECT_EQ(before.troubles(0).kind(), v1::Trouble::KIND_MISMATCH);

  restart();
  const v1::Job after = job(id);
  ASSERT_EQ(after.troubles_size(), 1);
  EXPECT_EQ(after.troubles(0).SerializeAsString(), before.troubles(0).SerializeAsString());
  v1::ExplainRequest why;
  why.set_job_id(id);
  FakeWorker third(channel_, "third");
  third.request().set_free_attempts(0);
  third.request().set_wait_ms(0);
  third.work();
  std::set<std::string> codes;
  const v1::ExplainResponse said = scheduler_->explain(why);
  for (const v1::Reason& reason : said.reasons()) {
    codes.insert(reason.code());
  }
  EXPECT_TRUE(codes.contains("mismatch"));
  // Further workers are asked as before, and the liar is found.
  third.request().set_free_attempts(1);
  third.request().set_wait_ms(5'000);
  for (int turn = 0; turn < 20 && job(id).troubles(0).liar().empty(); ++turn) {
    third.work();
  }
  EXPECT_EQ(job(id).troubles(0).liar(), "second");
  restart();
  EXPECT_EQ(job(id).troubles(0).liar(), "second");
}

TEST_F(Orders, Limits_AnswerWithTheirNames) {
  for (const char* id : {"r1", "r2", "r3"}) {
    (void)scheduler_->submit(request(id), anna());
  }
  const auto exhausted = core::Code::kResourceExhausted;
  EXPECT_EQ(code_of([&] { (void)scheduler_->submit(request("r4"), anna()); }, "user_jobs_limit"),
            exhausted);
  (void)scheduler_->submit(request("r3"), anna());  // the same again is no further one
  const v1::Job of_boris = scheduler_->submit(request("r4"), boris());
  (void)scheduler_->cancel(order(of_boris, boris()));
  restart();
  EXPECT_EQ(code_of([&] { (void)scheduler_->submit(request("r5"), anna()); }, "user_jobs_limit"),
            exhausted);
  journal_limit_bytes_ = 1000;
  restart();
  EXPECT_EQ(
      code_of([&] { (void)scheduler_->submit(request("r5"), boris()); }, "journal_limit_bytes"),
      exhausted);
}

TEST_F(Orders, DrainedWorker_GetsNothing_AcrossARestart) {
  FakeWorker worker(channel_, "w-1");
  worker.request().set_name("machine");
  worker.request().set_wait_ms(0);
  worker.work();
  const auto drain = [&](const std::string& worker_name, bool is_drained) {
    return scheduler_->drain(
        {std::string("d").append(std::to_string(++orders_)), worker_name, admin()}, is_drained);
  };
  const std::vector<v1::Worker> drained = drain("w-", true);
  ASSERT_EQ(drained.size(), 1U);
  EXPECT_TRUE(drained[0].drained());
  EXPECT_EQ(code_of([&] { (void)drain("x", true); }, "no worker 'x'"), core::Code::kNotFound);
  (void)scheduler_->submit(request("r1"), anna());
  restart();
  FakeWorker again(channel_, "w-2");  // another process of the same machine
  again.request().set_name("machine");
  again.request().set_wait_ms(300);
  EXPECT_FALSE(again.work());
  (void)drain("machine", false);
  again.request().set_wait_ms(10'000);
  EXPECT_TRUE(again.work());
}

TEST_F(Orders, Explain_NamesWhatHoldsTheSubject_AlsoAfterItsEnd) {
  const v1::Job job = scheduler_->submit(request("r1"), anna());
  v1::ExplainRequest of_job;
  of_job.set_job_id(job.id().substr(0, 5));
  ASSERT_GE(scheduler_->explain(of_job).reasons_size(), 1);
  EXPECT_EQ(scheduler_->explain(of_job).reasons(0).code(), "no_worker");
  (void)scheduler_->cancel(order(job, anna()));
  EXPECT_EQ(scheduler_->explain(of_job).verdict(), "was cancelled");
  EXPECT_EQ(scheduler_->explain(of_job).reasons(0).code(), "ended");
  v1::ExplainRequest of_worker;
  of_worker.set_worker("w-1");
  EXPECT_EQ(code_of([&] { (void)scheduler_->explain(of_worker); }, "no worker 'w-1'"),
            core::Code::kNotFound);
  FakeWorker worker(channel_, "w-1");
  worker.request().set_wait_ms(0);
  worker.work();
  EXPECT_NE(scheduler_->explain(of_worker).verdict(), "");
  EXPECT_EQ(code_of([&] { (void)scheduler_->explain({}); }, "names no"),
            core::Code::kInvalidArgument);
}

TEST_F(Orders, UnblockedWorker_IsNamed_AndUnknownOnesAreNot) {
  FakeWorker worker(channel_, "w-1");
  worker.request().set_wait_ms(0);
  worker.work();
  const auto unblock = [&](const std::string& subject, const std::string& stage) {
    return scheduler_->unblock(
        {std::string("u").append(std::to_string(++orders_)), subject, admin()}, stage);
  };
  EXPECT_EQ(unblock("w-1", "grid").size(), 1U);
  EXPECT_EQ(unblock("w-1", "").size(), 1U);
  EXPECT_EQ(code_of([&] { (void)unblock("w-1", "nonsense"); }, "nonsense"),
            core::Code::kInvalidArgument);
  EXPECT_EQ(code_of([&] { (void)unblock("y", ""); }, "no worker 'y'"), core::Code::kNotFound);
}

}  // namespace
}  // namespace weft::coordinator
