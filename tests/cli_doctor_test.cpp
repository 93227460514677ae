#include <string>

#include <gtest/gtest.h>

#include "cli/machine_checks.h"
#include "security/authority.h"
#include "tests/cli_programs.h"

namespace weft::cli {
namespace {

using State = MachineCheck::State;

nlohmann::json check_of(const nlohmann::json& report, const std::string& name) {
  for (const nlohmann::json& check : report.at("checks")) {
    if (check.at("name") == name) {
      return check;
    }
  }
  return nullptr;
}

TEST(Doctor, OfAMachineThatRunsTheTestsFindsTheSandboxAndTheProcessorGood) {
  const TestFolder folder;
  const Finished finished = run_weft(folder, {"doctor", "--json"});
  const nlohmann::json report = finished.json();
  EXPECT_EQ(finished.code, report.at("healthy").get<bool>() ? 0 : 1) << finished.err;
  EXPECT_EQ(check_of(report, "processor").at("state"), "good");
  EXPECT_EQ(check_of(report, "sandbox").at("state"), "good");
  EXPECT_NE(run_weft(folder, {"doctor"}).out.find("sandbox"), std::string::npos);
}

TEST(Doctor, ACoordinatorThatIsNamedAndAwayIsBroken) {
  const TestFolder folder;
  const Finished finished = run_weft(folder, {"doctor", "--coordinator", "127.0.0.1:1", "--json"});
  EXPECT_EQ(finished.code, 1);
  EXPECT_EQ(check_of(finished.json(), "coordinator").at("state"), "broken");
  EXPECT_NE(check_of(finished.json(), "coordinator").at("mend"), "");
  EXPECT_EQ(finished.json().at("healthy"), false);
}

TEST(Doctor, ACoordinatorThatAnswersIsGood) {
  const TestFolder folder;
  const TestCluster cluster(folder, "doctor", 0);
  const Finished finished = cluster.weft({"doctor", "--json"});
  EXPECT_EQ(check_of(finished.json(), "coordinator").at("state"), "good") << finished.out;
}

TEST(Doctor, ADiskThatCannotBeWrittenIsBroken) {
  EXPECT_EQ(check_disk("it", "/proc").state, State::kBroken);
  const TestFolder folder;
  const MachineCheck check = check_disk("it", folder.path() / "not" / "there" / "yet");
  EXPECT_NE(check.state, State::kBroken) << check.found;
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Doctor, ACertificateThatEndsSoonIsAWarningAndOneThatEndedIsBroken) {
  const TestFolder folder;
  const core::Clock::Time now{std::chrono::hours(24 * 20000)};
  security::Authority authority =
      security::Authority::make(folder / "authority", "test", std::chrono::days(3650), now);
  authority.issue("ann", {v1::ROLE_READER}, {}, std::chrono::days(100), folder / "ann", now);
  const security::Endpoint endpoint("hub:7411", folder / "ann", false);
  EXPECT_EQ(check_certificate(endpoint, now + std::chrono::days(1)).state, State::kGood);
  EXPECT_EQ(check_certificate(endpoint, now + std::chrono::days(90)).state, State::kWarning);
  EXPECT_EQ(check_certificate(endpoint, now + std::chrono::days(101)).state, State::kBroken);
  EXPECT_EQ(check_certificate("hub:7411", now).state, State::kGood);
  const security::Endpoint nowhere("hub:7411", folder / "bob", false);
  EXPECT_EQ(check_certificate(nowhere, now).state, State::kBroken);
}

TEST(Doctor, APortThatIsTakenIsNoted) {
  const TestFolder folder;
  const TestCluster cluster(folder, "port", 0);
  const std::string address = cluster.address();
  const auto port = static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1)));
  EXPECT_EQ(check_port("it", port, false).state, State::kNote);
  EXPECT_EQ(check_port("it", port, true).state, State::kGood);
}

}  // namespace
}  // namespace weft::cli
