#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <png.h>

#include "coordinator/web/png.h"
#include "coordinator/web/swatch_cache.h"
#include "coordinator/web/swatch_view.h"
#include "core/digest.h"
#include "core/error.h"
#include "proto/weft/v1/render.grpc.pb.h"
#include "tests/coordinator_page_fixture.h"

namespace weft::coordinator {
namespace {

// What libpng reads of it, as linear values of 16 bits.
std::vector<std::uint16_t> pixels_of(const std::string& png, std::uint32_t* width,
                                     std::uint32_t* height) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, png.data(), png.size()), 0) << image.message;
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, bytes.data(), 0, nullptr), 0) << image.message;
  *width = image.width;
  *height = image.height;
  return {bytes.begin(), bytes.end()};
}

TEST(SwatchPng, ShowsLinearLightAsSrgb) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> rgb = {0, 0.25F, 0.5F, nan, -1, 0.0030F, 100, 0.75F, 0.1F};
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  const std::vector<std::uint16_t> shown = pixels_of(png_of(rgb, 3, 1, 0), &width, &height);
  EXPECT_EQ(width, 3U);
  EXPECT_EQ(height, 1U);
  // IEC 61966-2-1; libpng rounds within one step.
  const std::vector<int> wanted = {0, 137, 188, 0, 0, 10, 255, 225, 89};
  ASSERT_EQ(shown.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(shown[i], wanted[i], 1) << i;
  }
  // A stop more is twice the light.
  EXPECT_EQ(pixels_of(png_of(std::vector<float>{0.125F, 0.25F, 0.05F}, 1, 1, 1), &width, &height),
            pixels_of(png_of(std::vector<float>{0.25F, 0.5F, 0.1F}, 1, 1, 0), &width, &height));
}

TEST(SwatchPng, ExposesTheLitPixelsToAMiddleTone) {
  EXPECT_EQ(automatic_exposure(std::vector<float>{0, 0, 0}), 0);
  EXPECT_NEAR(automatic_exposure(std::vector<float>{0.25F, 0, 0, 0, 0, 0}), 0, 1e-6);
  EXPECT_NEAR(automatic_exposure(std::vector<float>{0.1F, 0.5F, 0, 0, 0.5F, 0}), -1, 1e-6);
}

TEST(SwatchView, TakesWhatIsAskedAndRefusesTheRest) {
  const SwatchView usual = swatch_view_from({});
  EXPECT_EQ(usual.size, 240U);
  EXPECT_FALSE(usual.stops);
  const SwatchView view = swatch_view_from({{"light_azimuth", "-30.5"},
                                            {"sharpness", "parallel"},
                                            {"scattering", "multiple"},
                                            {"fill", "0"},
                                            {"stops", "-1.5"},
                                            {"size", "64"}});
  EXPECT_EQ(view.light_azimuth_deg, -30.5);
  EXPECT_EQ(view.sharpness, 0);
  EXPECT_EQ(view.scattering, v1::SCATTERING_MULTIPLE_ONLY);
  EXPECT_FALSE(view.fill);
  EXPECT_EQ(view.stops, -1.5F);
  EXPECT_EQ(view.size, 64U);
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"size", "100000"}, {"size", "-1"},    {"samples", "1e9"},      {"light_elevation", "x"},
      {"height", "nan"},  {"height", "inf"}, {"sharpness", "0"},      {"scattering", "both"},
      {"samples", "1x"},  {"stops", "many"}, {"camera_elevation", ""}};
  for (const auto& [field, value] : wrong) {
    try {
      (void)swatch_view_from({{field, value}});
      ADD_FAILURE() << field << " = " << value;
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
      EXPECT_EQ(std::string(error.what()).rfind(field, 0), 0U) << error.what();
    }
  }
}

TEST(SwatchView, TheCameraStandsUprightFromEverySide) {
  for (const double azimuth : {-90.0, 0.0, 77.0}) {
    for (const double elevation : {15.0, 62.0, 90.0}) {
      SwatchView view;
      view.camera_azimuth_deg = azimuth;
      view.camera_elevation_deg = elevation;
      const v1::Camera camera = scene_of(view, "silk@3").camera();
      const v1::Vector& p = camera.position();
      const v1::Vector& up = camera.up();
      EXPECT_NEAR(p.x() * up.x() + p.y() * up.y() + p.z() * up.z(), 0, 1e-9);
      EXPECT_NEAR(up.x() * up.x() + up.y() * up.y() + up.z() * up.z(), 1, 1e-9);
      EXPECT_GE(up.z(), -1e-9);
    }
  }
  const v1::Scene scene = scene_of({}, "silk@3");
  EXPECT_EQ(scene.cloths(0).fabric(), "silk@3");
  EXPECT_EQ(scene.lights_size(), 2);
  SwatchView parallel;
  parallel.sharpness = 0;
  parallel.fill = false;
  EXPECT_TRUE(scene_of(parallel, "silk@3").lights(0).has_directional());
  EXPECT_EQ(scene_of(parallel, "silk@3").lights_size(), 1);
}

class SwatchCacheTest : public testing::Test {
 protected:
  SwatchCacheTest() {
    std::string name = (std::filesystem::temp_directory_path() / "weft-swatch-XXXXXX").string();
    EXPECT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  ~SwatchCacheTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  // The file was used so long ago.
  void age(const std::string& name, int hours) const {
    const auto path = folder_ / (name + ".png");
    std::filesystem::last_write_time(
        path, std::filesystem::last_write_time(path) - std::chrono::hours(hours));
  }
  std::filesystem::path folder_;
};

TEST_F(SwatchCacheTest, KeepsWhatWasUsedLastWithinItsLimit) {
  SwatchCache cache(folder_, 100);
  EXPECT_FALSE(cache.find("a"));
  cache.keep("a", std::string(40, 'a'));
  cache.keep("b", std::string(40, 'b'));
  age("a", 2);
  age("b", 1);
  EXPECT_EQ(cache.find("a"), std::string(40, 'a'));  // used now, b an hour ago
  cache.keep("c", std::string(40, 'c'));
  EXPECT_TRUE(cache.find("a"));
  EXPECT_FALSE(cache.find("b"));
  EXPECT_TRUE(cache.find("c"));
  cache.keep("huge", std::string(101, 'h'));
  EXPECT_FALSE(cache.find("huge"));
}

// A render node that fills pictures with one colour, or answers with an error.
class FakeNode final : public v1::RenderService::Service {
 public:
  explicit FakeNode(const std::string& address) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort(address, grpc::InsecureServerCredentials());
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakeNode() override { server_->Shutdown(); }
  FakeNode(const FakeNode&) = delete;
  FakeNode& operator=(const FakeNode&) = delete;
  FakeNode(FakeNode&&) = delete;
  FakeNode& operator=(FakeNode&&) = delete;

  grpc::Status Render(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::RenderResponse, v1::RenderRequest>* stream) override {
    ++orders;
    v1::RenderRequest request;
    stream->Read(&request);
    const v1::Scene scene = request.order().scene();
    last_scene = scene;
    while (is_slow && !context->IsCancelled()) {
      std::this_thread::yield();
    }
    if (context->IsCancelled()) {
      ++given_up;
      return grpc::Status::CANCELLED;
    }
    if (!answer.ok()) {
      return answer;
    }
    const std::uint32_t width = scene.picture().width();
    v1::RenderResponse event;
    event.mutable_picture()->set_width(is_wrong ? 1'000'000 : width);
    event.mutable_picture()->set_height(width);
    event.mutable_picture()->set_finished(true);
    event.mutable_picture()->set_device("loom\r\nX-Evil: 1");
    event.mutable_picture()->add_planes(v1::PICTURE_PLANE_COLOUR);
    event.mutable_picture()->add_planes(v1::PICTURE_PLANE_STANDARD_ERROR);
    stream->Write(event);
    const std::vector<float> plane(std::size_t{3} * width * width, 0.25F);
    const std::string bytes(reinterpret_cast<const char*>(plane.data()),
                            plane.size() * sizeof(float));
    for (const std::string& part : {bytes.substr(0, 100), bytes.substr(100) + bytes}) {
      event.set_chunk(part);
      stream->Write(event);
    }
    ++answered;
    return grpc::Status::OK;
  }
  grpc::Status GetNode(grpc::ServerContext* /*context*/, const v1::GetNodeRequest* /*request*/,
                       v1::GetNodeResponse* response) override {
    response->set_device("loom");
    return grpc::Status::OK;
  }

  std::atomic<int> orders = 0;
  std::atomic<int> answered = 0;
  std::atomic<int> given_up = 0;
  std::atomic<bool> is_slow = false;
  bool is_wrong = false;
  grpc::Status answer;
  v1::Scene last_scene;

 private:
  std::unique_ptr<grpc::Server> server_;
};

class SwatchesTest : public PageTest {
 protected:
  void SetUp() override {
    PageTest::SetUp();
    node_address_ = "unix:" + (folder_ / "node").string();
    node_ = std::make_unique<FakeNode>(node_address_);
    open_with_node();
    ASSERT_EQ(publish("r1").state(), v1::JOB_STATE_SUCCEEDED);
  }
  void TearDown() override {
    PageTest::TearDown();
    node_.reset();
  }
  void open_with_node(bool draws_ahead = false) {
    PageOptions options;
    options.draws_ahead = draws_ahead;
    options.render_node.address = node_address_;
    open(options);
  }
  std::string node_address_;
  std::unique_ptr<FakeNode> node_;
};

TEST_F(SwatchesTest, AThumbnailIsDrawnOnceAndKept) {
  const httplib::Response first = get("/api/swatches/tiny/1?kind=thumbnail");
  ASSERT_EQ(first.status, 200) << problem_of(first);
  EXPECT_EQ(first.get_header_value("Content-Type"), "image/png");
  EXPECT_EQ(node_->orders, 1);
  open_with_node();  // as after a restart
  EXPECT_EQ(get("/api/swatches/tiny/1?kind=thumbnail").body, first.body);
  EXPECT_EQ(node_->orders, 1);
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  EXPECT_NEAR(pixels_of(first.body, &width, &height)[0], 137, 1);
  EXPECT_EQ(width, 240U);
}

TEST_F(SwatchesTest, ATurnedSwatchIsDrawnAsAsked) {
  const httplib::Response turned =
      get("/api/swatches/tiny/1?light_elevation=90&scattering=single&size=32&samples=2&stops=1");
  ASSERT_EQ(turned.status, 200) << problem_of(turned);
  EXPECT_NEAR(node_->last_scene.lights(0).sg().towards().z(), 1, 1e-9);
  EXPECT_EQ(node_->last_scene.integration().scattering(), v1::SCATTERING_SINGLE_ONLY);
  EXPECT_EQ(node_->last_scene.picture().samples_per_pixel(), 2U);
  EXPECT_EQ(node_->last_scene.cloths(0).fabric(), "tiny@1");
  EXPECT_EQ(turned.get_header_value("X-Weft-Stops"), "1.000");
  EXPECT_EQ(turned.get_header_value("X-Weft-Device"), "loom??X-Evil: 1");
  std::uint32_t side = 0;
  EXPECT_NEAR(pixels_of(turned.body, &side, &side)[0], 188, 1);
  EXPECT_EQ(side, 32U);
  EXPECT_EQ(get("/api/swatches/tiny/1?size=7").status, 400);
  EXPECT_EQ(get("/api/swatches/tiny/2").status, 404);
  EXPECT_EQ(get("/api/swatches/linen/1").status, 404);
}

TEST_F(SwatchesTest, WhatTheNodeSaysIsSaid) {
  node_->answer = {grpc::StatusCode::FAILED_PRECONDITION, "the fabric lacks transfer"};
  const httplib::Response response = get("/api/swatches/tiny/1?kind=thumbnail");
  EXPECT_EQ(response.status, 409);
  EXPECT_NE(problem_of(response).find("the fabric lacks transfer"), std::string::npos);
  node_->answer = grpc::Status::OK;
  node_->is_wrong = true;
  EXPECT_EQ(get("/api/swatches/tiny/1").status, 500);
  node_->is_wrong = false;
  EXPECT_EQ(get("/api/swatches/tiny/1?kind=thumbnail").status, 200) << "a failure is not kept";
}

TEST_F(SwatchesTest, WhereNoNodeIsOrItIsAwayThePageSaysSo) {
  EXPECT_EQ(json("/api/node")["device"], "loom");
  node_.reset();
  const httplib::Response away = get("/api/swatches/tiny/1");
  EXPECT_EQ(away.status, 503);
  EXPECT_NE(problem_of(away).find("does not answer"), std::string::npos);
  EXPECT_EQ(json("/api/node")["answers"], false);
  open({});
  const httplib::Response none = get("/api/swatches/tiny/1");
  EXPECT_EQ(none.status, 409);
  EXPECT_NE(problem_of(none).find("--render-node"), std::string::npos);
  EXPECT_EQ(json("/api/node")["configured"], false);
}

TEST_F(SwatchesTest, SoManyPicturesAtATimeAndNoneHoldsUpTheEnd) {
  node_->is_slow = true;
  std::vector<std::thread> askers;
  for (std::size_t i = 0; i < kOrdersAtOnce; ++i) {
    askers.emplace_back([this] {
      httplib::Client client(page_->url().substr(0, page_->url().size() - 1));
      client.set_read_timeout(60);
      (void)client.Get("/api/swatches/tiny/1");
    });
  }
  while (node_->orders < static_cast<int>(kOrdersAtOnce)) {
    std::this_thread::yield();
  }
  const httplib::Response refused = get("/api/swatches/tiny/1");
  EXPECT_EQ(refused.status, 503);
  EXPECT_NE(problem_of(refused).find("pictures_limit"), std::string::npos);
  EXPECT_EQ(get("/api/jobs").status, 200);
  page_->stop();
  for (std::thread& asker : askers) {
    asker.join();
  }
}

TEST_F(SwatchesTest, AThumbnailIsDrawnWhenItsVersionIsPublished) {
  open_with_node(true);
  ASSERT_EQ(publish("r2", "linen").state(), v1::JOB_STATE_SUCCEEDED);
  while (node_->answered == 0) {
    std::this_thread::yield();
  }
  // The version that was there before waits for somebody who looks.
  EXPECT_EQ(node_->last_scene.cloths(0).fabric(), "linen@1");
  EXPECT_EQ(get("/api/swatches/linen/1?kind=thumbnail").status, 200);
  EXPECT_EQ(node_->orders, 1);
}

TEST_F(SwatchesTest, AThumbnailMakesWayForATurnedSwatchAndIsDrawnAfterIt) {
  node_->is_slow = true;
  int status = 0;
  std::thread asker([&] {
    httplib::Client client(page_->url().substr(0, page_->url().size() - 1));
    client.set_read_timeout(60);
    const httplib::Result result = client.Get("/api/swatches/tiny/1?kind=thumbnail");
    status = result ? result->status : 0;
  });
  while (node_->orders < 1) {
    std::this_thread::yield();
  }
  httplib::Client client(page_->url().substr(0, page_->url().size() - 1));
  client.set_read_timeout(60);
  std::thread turner([&] { EXPECT_EQ(client.Get("/api/swatches/tiny/1?size=32")->status, 200); });
  while (node_->orders < 2) {
    std::this_thread::yield();
  }
  while (node_->given_up < 1) {  // the thumbnail was, though the node still draws for the other
    std::this_thread::yield();
  }
  EXPECT_EQ(node_->orders, 2) << "it is not ordered again while somebody waits";
  node_->is_slow = false;
  turner.join();
  asker.join();
  EXPECT_EQ(status, 200);
  EXPECT_EQ(node_->orders, 3);
}

TEST_F(SwatchesTest, TwoWhoWantOneThumbnailHaveItDrawnOnce) {
  node_->is_slow = true;
  std::vector<std::thread> askers;
  std::atomic<int> good = 0;
  for (int i = 0; i < 3; ++i) {
    askers.emplace_back([&] {
      httplib::Client client(page_->url().substr(0, page_->url().size() - 1));
      client.set_read_timeout(60);
      const httplib::Result result = client.Get("/api/swatches/tiny/1?kind=thumbnail");
      good += result && result->status == 200 ? 1 : 0;
    });
  }
  while (node_->orders < 1) {
    std::this_thread::yield();
  }
  node_->is_slow = false;
  for (std::thread& asker : askers) {
    asker.join();
  }
  EXPECT_EQ(good, 3);
  EXPECT_EQ(node_->orders, 1);
}

TEST_F(SwatchesTest, WhatAViewerWishesNowEndsWhatItWishedBefore) {
  node_->is_slow = true;
  const auto ask = [this](const std::string& viewer, int* status) {
    return std::thread([this, viewer, status] {
      httplib::Client client(page_->url().substr(0, page_->url().size() - 1));
      client.set_read_timeout(60);
      const httplib::Result result = client.Get("/api/swatches/tiny/1?viewer=" + viewer);
      *status = result ? result->status : 0;
    });
  };
  int before = 0;
  int other = 0;
  int now = 0;
  std::thread first = ask("ann", &before);
  std::thread somebody = ask("bob", &other);
  while (node_->orders < 2) {
    std::this_thread::yield();
  }
  std::thread second = ask("ann", &now);
  first.join();  // though the node still draws for it
  EXPECT_EQ(before, 503);
  node_->is_slow = false;
  second.join();
  somebody.join();
  EXPECT_EQ(now, 200);
  EXPECT_EQ(other, 200);
}

}  // namespace
}  // namespace weft::coordinator
