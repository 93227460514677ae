#include <cstdlib>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "coordinator/web/event_stream.h"
#include "security/authority.h"
#include "tests/coordinator_page_fixture.h"
#include "tests/security_calls.h"

namespace weft::coordinator {
namespace {

TEST_F(PageTest, ThePageAndItsFilesAreServedAndMayOnlyLoadWhatIsServed) {
  const httplib::Response index = get("/");
  EXPECT_EQ(index.status, 200);
  EXPECT_EQ(index.get_header_value("Content-Type"), "text/html; charset=utf-8");
  EXPECT_NE(index.body.find("main.js"), std::string::npos);
  for (const char* file : {"/main.js", "/page.css", "/swatch.css", "/icon.svg", "/live.js"}) {
    const httplib::Response response = get(file);
    EXPECT_EQ(response.status, 200) << file;
    const std::string policy = response.get_header_value("Content-Security-Policy");
    EXPECT_EQ(policy.rfind("default-src 'none'; script-src 'self'; style-src 'self';", 0), 0U);
    EXPECT_EQ(policy.find("unsafe"), std::string::npos);
    EXPECT_EQ(response.get_header_value("X-Content-Type-Options"), "nosniff");
  }
  EXPECT_EQ(get("/nothing.js").status, 404);
  EXPECT_EQ(get("/../etc/passwd").status, 404);
}

TEST_F(PageTest, AFileThatIsKnownIsNotSentAgain) {
  const std::string etag = get("/main.js").get_header_value("ETag");
  ASSERT_FALSE(etag.empty());
  const httplib::Response again = get("/main.js", {{"If-None-Match", etag}});
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
  EXPECT_EQ(get("/main.js", {{"If-None-Match", "\"other\""}}).status, 200);
}

TEST_F(PageTest, AHostNameOfSomebodyElseIsRefused) {
  for (const char* host : {"evil.example", "evil.example:7413", "localhost.evil.example", ""}) {
    const httplib::Response response = get("/api/jobs", {{"Host", host}});
    EXPECT_EQ(response.status, 421) << host;
    EXPECT_EQ(response.body.find("\"jobs\""), std::string::npos);
  }
  for (const char* host : {"localhost:7413", "LOCALHOST", "127.0.0.1:1", "[::1]:7413"}) {
    EXPECT_EQ(get("/api/jobs", {{"Host", host}}).status, 200) << host;
  }
  PageOptions options;
  options.hosts = {"Hub.example"};
  open(options);
  EXPECT_EQ(get("/api/jobs", {{"Host", "hub.example:80"}}).status, 200);
}

TEST_F(PageTest, APageOfAnotherSiteMayOnlyLinkHere) {
  EXPECT_EQ(get("/", {{"Sec-Fetch-Site", "cross-site"}}).status, 200);
  for (const char* path : {"/api/jobs", "/metrics", "/main.js", "/api/diff?from=a@1&to=a@2"}) {
    EXPECT_EQ(get(path, {{"Sec-Fetch-Site", "cross-site"}}).status, 403) << path;
    EXPECT_EQ(get(path, {{"Sec-Fetch-Site", "same-site"}}).status, 403) << path;
  }
  EXPECT_EQ(get("/api/jobs", {{"Sec-Fetch-Site", "same-origin"}}).status, 200);
  EXPECT_EQ(get("/api/jobs", {{"Sec-Fetch-Site", "none"}}).status, 200);
}

TEST_F(PageTest, NothingCanBeChangedThroughThePage) {
  ASSERT_TRUE(submit("r1", small_description()).ok());
  const std::string before = get("/api/jobs").body;
  EXPECT_EQ(client_->Post("/api/jobs", "{}", "application/json")->status, 405);
  EXPECT_EQ(client_->Put("/api/jobs", "{}", "application/json")->status, 405);
  EXPECT_EQ(client_->Delete("/api/jobs")->status, 405);
  EXPECT_EQ(client_->Post("/", "x", "text/plain")->get_header_value("Allow"), "GET, HEAD");
  EXPECT_EQ(client_->Head("/")->status, 200);
  EXPECT_EQ(get("/api/jobs").body, before);
}

TEST_F(PageTest, ItsDataAreTheMessagesOfTheProtocol) {
  const v1::Job ended = publish("r1");
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  const nlohmann::json jobs = json("/api/jobs");
  ASSERT_EQ(jobs["jobs"].size(), 1U);
  EXPECT_EQ(jobs["jobs"][0]["id"], ended.id());
  EXPECT_EQ(jobs["jobs"][0]["state"], "JOB_STATE_SUCCEEDED");
  EXPECT_EQ(json("/api/jobs/" + ended.id())["job"]["fabric"], "tiny");
  EXPECT_EQ(json("/api/jobs/" + ended.id() + "/explain")["subject"], "job " + ended.id());

  const std::string attempts = "/api/jobs/" + ended.id() + "/attempts";
  EXPECT_GE(json(attempts)["attempts"].size(), 7U);
  EXPECT_EQ(json(attempts + "?limit=2")["attempts"].size(), 2U);
  for (const nlohmann::json& attempt : json(attempts + "?stage=geometry")["attempts"]) {
    EXPECT_EQ(attempt["stage"], "geometry");
    EXPECT_EQ(attempt["outcome"], "succeeded");
  }
  EXPECT_EQ(json(attempts + "?stage=geometry&shard=7").count("attempts"), 0U);

  EXPECT_EQ(json("/api/fabrics")["fabrics"][0]["name"], "tiny");
  EXPECT_EQ(json("/api/fabrics/tiny/versions")["versions"][0]["number"], "1");
  EXPECT_EQ(json("/api/fabrics/tiny/history")["entries"][0]["action"], "published");
  EXPECT_EQ(json("/api/workers")["workers"][0]["name"], "w-r1");
  EXPECT_EQ(json("/api/workers/w-r1/explain")["subject"].get<std::string>().rfind("worker", 0), 0U);
}

TEST_F(PageTest, WhatIsNotThereIsSaidInWords) {
  EXPECT_EQ(get("/api/jobs/jabc").status, 404);
  EXPECT_NE(problem_of(get("/api/jobs/jabc")).find("there is no job 'jabc'"), std::string::npos);
  EXPECT_EQ(get("/api/fabrics/silk/versions").status, 404);
  EXPECT_EQ(get("/api/nothing").status, 404);
  EXPECT_EQ(get("/api/jobs/a/b/c/d/e").status, 404);
  EXPECT_EQ(get("/api/jobs?limit=many").status, 400);
  EXPECT_EQ(get("/api/diff?from=a%20b&to=c").status, 400);
  EXPECT_EQ(get("/api/events?job=jabc").status, 404);
}

TEST_F(PageTest, AnAttemptsLogIsReadFromWhereTheReaderIs) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  ASSERT_TRUE(scheduler_->logs().append(submitted.id(), 5, 0, "one\ntwo\n<b>three</b>\n"));
  const std::string log = "/api/jobs/" + submitted.id() + "/attempts/5/log";
  const httplib::Response all = get(log);
  EXPECT_EQ(all.get_header_value("Content-Type"), "text/plain; charset=utf-8");
  EXPECT_EQ(all.body, "one\ntwo\n<b>three</b>\n");
  EXPECT_EQ(all.get_header_value("X-Weft-Next"), std::to_string(all.body.size()));
  EXPECT_EQ(get(log + "?offset=4").body, "two\n<b>three</b>\n");
  EXPECT_EQ(get(log + "?last=13").body, "<b>three</b>\n");
  EXPECT_EQ(get(log + "?offset=" + all.get_header_value("X-Weft-Next")).body, "");
  EXPECT_EQ(get("/api/jobs/" + submitted.id() + "/attempts/x/log").status, 400);
}

// Reads server-sent events until `enough` says so of all that came.
std::string read_events(const std::string& url, const std::string& path,
                        const std::function<bool(const std::string&)>& enough) {
  httplib::Client client(url.substr(0, url.size() - 1));
  client.set_read_timeout(30);
  std::string all;
  client.Get(path, [&](const char* data, std::size_t size) {
    all.append(data, size);
    return !enough(all);
  });
  return all;
}

TEST_F(PageTest, WhoeverWatchesIsToldWhatChanges) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  bool is_published = false;
  const std::string events =
      read_events(page_->url(), "/api/events?job=" + submitted.id(), [&](const std::string& all) {
        if (!is_published && all.find("event: explain") != std::string::npos) {
          is_published = true;
          publish("r1");
        }
        return all.find("JOB_STATE_SUCCEEDED") != std::string::npos &&
               all.find("event: jobs") != std::string::npos;
      });
  for (const char* name : {"jobs", "workers", "fabrics", "job", "explain"}) {
    EXPECT_NE(events.find(std::string("event: ") + name + "\ndata: {\"now_ms\":"),
              std::string::npos)
        << name;
  }
  EXPECT_NE(events.find("JOB_STATE_QUEUED"), std::string::npos);
  EXPECT_NE(events.find("\"unfinished\":1,"), std::string::npos);
}

TEST_F(PageTest, SoManyWatchAndNoMore) {
  std::vector<std::thread> watchers;
  std::atomic<int> watching = 0;
  std::atomic<bool> is_over = false;
  for (int i = 0; i < kStreamsLimit; ++i) {
    watchers.emplace_back([&] {
      bool has_begun = false;
      read_events(page_->url(), "/api/events", [&](const std::string&) {
        watching += has_begun ? 0 : 1;
        has_begun = true;
        return is_over.load();
      });
    });
  }
  while (watching < kStreamsLimit) {
    std::this_thread::yield();
  }
  const httplib::Response refused = get("/api/events");
  EXPECT_EQ(refused.status, 503);
  EXPECT_NE(problem_of(refused).find("streams_limit"), std::string::npos);
  // The page answers all the same, and so does the coordinator.
  EXPECT_EQ(get("/").status, 200);
  EXPECT_EQ(figure("weft_page_streams"), kStreamsLimit);
  EXPECT_TRUE(submit("r1", small_description()).ok());
  is_over = true;
  page_->stop();
  for (std::thread& watcher : watchers) {
    watcher.join();
  }
}

TEST_F(PageTest, WithTlsOnlyCertificatesOfTheAuthorityWithTheRoleSeeAnything) {
  const security::TestAuthority authority;
  PageOptions options;
  options.state_folder = folder_ / "state";
  options.listen = {"127.0.0.1:0", authority.issue("hub", {}, {"127.0.0.1"}), false};
  const Page page(*scheduler_, metrics_, options);
  ASSERT_EQ(page.url().rfind("https://", 0), 0U);
  const std::string address = page.url().substr(0, page.url().size() - 1);
  const auto status_as = [&](const std::filesystem::path& folder) {
    httplib::Client client(address, folder / "cert.pem", folder / "key.pem");
    client.set_ca_cert_path((authority.folder_of("hub") / "ca.pem").string());
    const httplib::Result result = client.Get("/api/jobs");
    return result ? result->status : 0;
  };
  EXPECT_EQ(status_as(authority.issue("ann", {v1::ROLE_READER})), 200);
  EXPECT_EQ(status_as(authority.issue("root", {v1::ROLE_ADMIN})), 200);
  EXPECT_EQ(status_as(authority.issue("mill", {v1::ROLE_WORKER})), 403);
  EXPECT_EQ(status_as(authority.folder_of("hub")), 403) << "a certificate without a role";
  const security::TestAuthority foreign;
  EXPECT_EQ(status_as(foreign.issue("eve", {v1::ROLE_ADMIN})), 0);
  httplib::Client nobody(address);
  nobody.enable_server_certificate_verification(false);
  EXPECT_FALSE(nobody.Get("/api/jobs"));

  authority.authority().revoke("ann", authority.now());
  std::filesystem::copy_file(authority.folder_of("authority") / "revoked.pem",
                             authority.folder_of("hub") / "revoked.pem",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(status_as(authority.folder_of("ann")), 403);
}

TEST_F(PageTest, OtherMachinesAreNotLetInWithoutTls) {
  PageOptions options;
  options.state_folder = folder_ / "state";
  const auto code_of = [&](const security::Endpoint& listen) {
    options.listen = listen;
    try {
      const Page page(*scheduler_, metrics_, options);
    } catch (const core::Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(code_of({"0.0.0.0:0", "", false}).find("can be reached from other machines"),
            std::string::npos);
  EXPECT_EQ(code_of({"0.0.0.0:0", "", true}), "");
  EXPECT_NE(code_of("unix:/page").find("HOST:PORT"), std::string::npos);
  EXPECT_NE(code_of("7413").find("HOST:PORT"), std::string::npos);
  const std::string taken = page_->url().substr(7);
  EXPECT_NE(code_of(taken.substr(0, taken.size() - 1)).find("another program"), std::string::npos);
}

}  // namespace
}  // namespace weft::coordinator
