#include <chrono>
#include <string>

#include "tests/coordinator_service_fixture.h"
#include "tests/faulty_disk.h"
#include "tests/security_calls.h"

// What whoever asks with gRPC's health service is told.

namespace weft::coordinator {
namespace {

constexpr const char* kServing = "\x08\x01";
constexpr const char* kNotServing = "\x08\x02";
constexpr std::chrono::seconds kDeadline{60};

class Health : public ServiceTest {
 protected:
  security::AnyCall watch() {
    return security::AnyCall(channel_, "/grpc.health.v1.Health/Watch", kDeadline);
  }
  [[nodiscard]] std::string check() {
    security::AnyCall call(channel_, "/grpc.health.v1.Health/Check", kDeadline);
    EXPECT_TRUE(call.wait().ok());
    return call.answer();
  }

  FaultyDisk disk_;  // before the coordinator, and after it
};

TEST_F(Health, AJournalThatCannotBeWritten_IsNotServing) {
  security::AnyCall watched = watch();
  ASSERT_TRUE(watched.wait_for_answer(kServing));
  EXPECT_EQ(check(), kServing);
  disk_.arm(1, FaultyDisk::Fault::kFull);
  EXPECT_EQ(submit("r1", small_description("silk")).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_TRUE(watched.wait_for_answer(kNotServing));
  EXPECT_EQ(check(), kNotServing);
  EXPECT_FALSE(watched.is_done());
  disk_.disarm();
  EXPECT_EQ(check(), kNotServing) << "its memory is ahead of its disk, whatever that does now";
}

TEST_F(Health, ACoordinatorThatStops_SaysSoBeforeItHangsUp) {
  security::AnyCall watched = watch();
  ASSERT_TRUE(watched.wait_for_answer(kServing));
  server_->stop();
  EXPECT_TRUE(watched.wait_for_answer(kNotServing));
}

}  // namespace
}  // namespace weft::coordinator
