#pragma once

#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <httplib.h>
#include <nlohmann/json.hpp>

#include "coordinator/web/metrics.h"
#include "coordinator/web/page.h"
#include "tests/coordinator_service_fixture.h"

namespace weft::coordinator {

// A coordinator with its page, both on loopback ports.
class PageTest : public ServiceTest {
 protected:
  void SetUp() override {
    ServiceTest::SetUp();
    open({});
  }
  void TearDown() override {
    page_.reset();
    ServiceTest::TearDown();
  }
  void configure(SchedulerOptions& options) override { options.hooks = metrics_.hooks(); }

  // Opens the page in place of the one before.
  void open(PageOptions options) {
    page_.reset();
    options.state_folder = folder_ / "state";
    options.listen.address = "127.0.0.1:0";
    page_ = std::make_unique<Page>(*scheduler_, metrics_, options);
    std::string address = page_->url();
    address.pop_back();
    client_ = std::make_unique<httplib::Client>(address);
    client_->set_read_timeout(30);
  }

  httplib::Response get(const std::string& path, const httplib::Headers& headers = {}) {
    const httplib::Result result = client_->Get(path, headers);
    EXPECT_TRUE(result) << path << ": " << httplib::to_string(result.error());
    return result ? result.value() : httplib::Response();
  }
  nlohmann::json json(const std::string& path) {
    const httplib::Response response = get(path);
    EXPECT_EQ(response.status, 200) << path << ": " << response.body;
    EXPECT_EQ(response.get_header_value("Content-Type"), "application/json");
    return nlohmann::json::parse(response.body, nullptr, false);
  }
  // What is wrong, in the page's words.
  static std::string problem_of(const httplib::Response& response) {
    const nlohmann::json json = nlohmann::json::parse(response.body, nullptr, false);
    return json.is_discarded() ? response.body : json["error"]["message"].get<std::string>();
  }
  // The figure behind a line's beginning in /metrics; -1: there is no such line.
  double figure(const std::string& name) {
    const std::string text = "\n" + get("/metrics").body;
    const std::size_t at = text.find("\n" + name + " ");
    return at == std::string::npos ? -1 : std::stod(text.substr(at + name.size() + 2));
  }

  // A job of small_description, run to its end.
  v1::Job publish(const std::string& request_id, const std::string& fabric = "tiny") {
    v1::Job submitted;
    EXPECT_TRUE(submit(request_id, small_description(fabric), &submitted).ok());
    FakeWorker worker(channel_, "w-" + request_id);
    for (int i = 0; i < 1000 && job(submitted.id()).ended_at_ms() == 0; ++i) {
      worker.request().set_wait_ms(50);
      worker.work();
    }
    return job(submitted.id());
  }

  Metrics metrics_;
  std::unique_ptr<Page> page_;
  std::unique_ptr<httplib::Client> client_;
};

}  // namespace weft::coordinator
