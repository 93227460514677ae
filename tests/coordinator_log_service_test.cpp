#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "coordinator/services/log_service.h"
#include "proto/limits.h"
#include "tests/coordinator_service_fixture.h"

// Logs from workers to people, through the real services.

namespace weft::coordinator {
namespace {

class LogServiceTest : public ServiceTest {
 protected:
  // A job, and the first thing that a worker is given of it.
  v1::Assignment begin(FakeWorker& worker, std::string* job) {
    v1::Job submitted;
    EXPECT_TRUE(submit("request-1", small_description(), &submitted).ok());
    *job = submitted.id();
    for (int tries = 0; tries < 100; ++tries) {
      v1::SynchronizeResponse response;
      EXPECT_TRUE(worker.exchange(&response).ok());
      if (response.assignments_size() > 0) {
        return response.assignments(0);
      }
    }
    ADD_FAILURE() << "nothing was assigned";
    return {};
  }
  static v1::AppendLogRequest log_of(const v1::Assignment& assignment, std::uint64_t offset,
                                     const std::string& text) {
    v1::AppendLogRequest request;
    request.set_job_id(assignment.name().job_id());
    request.set_attempt(assignment.name().attempt());
    request.set_lease_token(assignment.lease_token());
    request.set_offset(offset);
    request.set_text(text);
    return request;
  }
  grpc::Status append(const v1::AppendLogRequest& request, std::uint64_t* size = nullptr) {
    grpc::ClientContext context;
    v1::AppendLogResponse response;
    const auto stub = v1::WorkerService::NewStub(channel_);
    const grpc::Status status = stub->AppendLog(&context, request, &response);
    if (size != nullptr) {
      *size = response.size_bytes();
    }
    return status;
  }
  grpc::Status read(const v1::ReadLogsRequest& request, std::string* text,
                    std::vector<v1::AttemptInfo>* attempts = nullptr) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    const auto reader = jobs_->ReadLogs(&context, request);
    v1::ReadLogsResponse response;
    while (reader->Read(&response)) {
      *text += response.text();
      if (attempts != nullptr && response.has_attempt()) {
        attempts->push_back(response.attempt());
      }
    }
    return reader->Finish();
  }
};

TEST_F(LogServiceTest, WhatAWorkerLogsIsReadUnderItsAttemptAlsoAfterARestart) {
  FakeWorker worker(channel_, "w1");
  std::string job;
  const v1::Assignment assignment = begin(worker, &job);
  std::uint64_t size = 0;
  EXPECT_TRUE(append(log_of(assignment, 0, "one\n"), &size).ok());
  EXPECT_EQ(size, 4U);
  EXPECT_TRUE(append(log_of(assignment, 4, "two\n"), &size).ok());
  EXPECT_EQ(append(log_of(assignment, 99, "far\n")).error_code(), grpc::StatusCode::OUT_OF_RANGE);
  stop();
  start();
  v1::ReadLogsRequest request;
  request.set_job_id(job.substr(0, 6));
  std::string text;
  std::vector<v1::AttemptInfo> attempts;
  EXPECT_TRUE(read(request, &text, &attempts).ok());
  EXPECT_EQ(text, "one\ntwo\n");
  ASSERT_EQ(attempts.size(), 1U);
  EXPECT_EQ(attempts[0].stage(), assignment.stage());
  EXPECT_EQ(attempts[0].worker(), "w1");
  EXPECT_EQ(attempts[0].name().attempt(), assignment.name().attempt());
  EXPECT_EQ(attempts[0].log_bytes(), 8U);
}

TEST_F(LogServiceTest, OnlyTheOwnerMayAddToTheLogOfAnAttemptThatRuns) {
  FakeWorker worker(channel_, "w1");
  std::string job;
  const v1::Assignment assignment = begin(worker, &job);
  v1::AppendLogRequest stranger = log_of(assignment, 0, "x\n");
  stranger.set_lease_token("another");
  EXPECT_EQ(append(stranger).error_code(), grpc::StatusCode::NOT_FOUND);
  v1::AppendLogRequest unknown = log_of(assignment, 0, "x\n");
  unknown.set_attempt(12345);
  EXPECT_EQ(append(unknown).error_code(), grpc::StatusCode::NOT_FOUND);
  v1::AppendLogRequest elsewhere = log_of(assignment, 0, "x\n");
  elsewhere.set_job_id("j000000000000");
  EXPECT_EQ(append(elsewhere).error_code(), grpc::StatusCode::NOT_FOUND);
  elsewhere.set_job_id("../../etc");
  EXPECT_EQ(append(elsewhere).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(append(log_of(assignment, 0, std::string(70'000, 'x'))).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(LogServiceTest, FiltersByAttemptStageAndShard) {
  FakeWorker worker(channel_, "w1");
  std::string job;
  const v1::Assignment assignment = begin(worker, &job);
  ASSERT_TRUE(append(log_of(assignment, 0, "one\n")).ok());
  v1::ReadLogsRequest request;
  request.set_job_id(job);
  const auto text_of = [&] {
    std::string text;
    EXPECT_TRUE(read(request, &text).ok());
    return text;
  };
  request.set_stage(assignment.stage());
  EXPECT_EQ(text_of(), "one\n");
  request.set_with_shard(true);
  request.set_shard(assignment.first_shard());
  EXPECT_EQ(text_of(), "one\n");
  request.set_shard(assignment.first_shard() + assignment.shards());
  EXPECT_EQ(text_of(), "");
  request.set_stage("transfer");
  EXPECT_EQ(text_of(), "");
  std::string text;
  request.set_attempt(5);
  EXPECT_EQ(read(request, &text).error_code(), grpc::StatusCode::NOT_FOUND);
  request.set_job_id("jnone");
  EXPECT_EQ(read(request, &text).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(LogServiceTest, AFollowerGetsLinesAsTheyComeUntilTheJobHasEnded) {
  FakeWorker worker(channel_, "w1");
  std::string job;
  const v1::Assignment assignment = begin(worker, &job);
  ASSERT_TRUE(append(log_of(assignment, 0, "one\n")).ok());
  std::string text;
  grpc::Status status;
  std::thread follower([&] {
    v1::ReadLogsRequest request;
    request.set_job_id(job);
    request.set_follow(true);
    status = read(request, &text);
  });
  ASSERT_TRUE(append(log_of(assignment, 4, "two\n")).ok());
  grpc::ClientContext context;
  v1::CancelJobRequest cancel;
  cancel.set_request_id("cancel-1");
  cancel.set_job_id(job);
  v1::CancelJobResponse cancelled;
  ASSERT_TRUE(jobs_->CancelJob(&context, cancel, &cancelled).ok());
  ASSERT_TRUE(append(log_of(assignment, 8, "three\n")).ok()) << "late, but it was given to it";
  follower.join();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(text, "one\ntwo\nthree\n");
}

TEST_F(LogServiceTest, ReadersAreLimited) {
  FakeWorker worker(channel_, "w1");
  std::string job;
  ASSERT_TRUE(append(log_of(begin(worker, &job), 0, "one\n")).ok());
  v1::ReadLogsRequest request;
  request.set_job_id(job);
  request.set_follow(true);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ReadLogsResponse>>> readers;
  for (int i = 0; i < v1::kLogReadersPerConnectionLimit; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(jobs_->ReadLogs(contexts.back().get(), request));
    v1::ReadLogsResponse response;
    EXPECT_TRUE(readers.back()->Read(&response)) << "it follows";
  }
  std::string text;
  const grpc::Status status = read(request, &text);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(status.error_message().find("log_readers_per_connection_limit:"), std::string::npos);
  for (std::size_t i = 0; i < readers.size(); ++i) {
    contexts[i]->TryCancel();
    (void)readers[i]->Finish();
  }
}

}  // namespace
}  // namespace weft::coordinator
