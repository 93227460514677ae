#include <atomic>
#include <chrono>
#include <thread>

#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "core/digest.h"
#include "tests/render_node_fixture.h"

namespace weft::render {
namespace {

using test::KeptPictures;
using test::NodeTest;

v1::Scene brightening(v1::Scene scene) {
  v1::Animation& animation = *scene.mutable_animation();
  animation.set_first_frame(3);
  animation.set_frames(3);
  for (int i = 0; i < 2; ++i) {
    v1::LightKey& key = *animation.add_lights();
    key.set_frame(3 + 2 * i);
    *key.mutable_value() = scene.lights(0);
    key.mutable_value()->mutable_sg()->mutable_irradiance()->set_r(1 + i);
  }
  return scene;
}

TEST_F(NodeTest, DrawsWhatIsDrawnInProcessBitByBit) {
  start();
  KeptPictures there;
  draw(small_scene("one@1"), false, there);
  KeptPictures here;
  draw_here(small_scene("one@1"), 0.5f, false, here);
  ASSERT_EQ(there.finished.size(), 1u);
  test::expect_same(there.finished[0], here.finished.at(0));
  EXPECT_GT(there.finished[0].drawing.cloth_mean.x, 0);
}

TEST_F(NodeTest, DrawsOnItsDeviceWhatTheDeviceDrawsInProcess) {
  options_.device = "0";
  start();
  KeptPictures there;
  draw(small_scene("one@1"), false, there);
  draw(small_scene("one@1"), true, there);
  gpu::DeviceRenderer device("0");
  EXPECT_EQ(client().node().device(), device.info().name);
  KeptPictures here;
  draw_here(small_scene("one@1"), 0.5f, false, here, &device);
  ASSERT_EQ(there.finished.size(), 2u);
  for (const Picture& picture : there.finished) {
    EXPECT_EQ(picture.device, device.info().name);
    test::expect_same(picture, here.finished.at(0));
  }
  EXPECT_GT(here.finished.at(0).drawing.cloth_mean.x, 0);
}

TEST_F(NodeTest, SendsPassesAndTheFramesOfAnAnimation) {
  start();
  const v1::Scene scene = brightening(small_scene("one@1"));
  KeptPictures there;
  draw(scene, true, there);
  KeptPictures here;
  draw_here(scene, 0.5f, true, here);
  ASSERT_EQ(there.finished.size(), 3u);
  ASSERT_EQ(there.frames.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(there.frames[i].number, 3 + i);
    EXPECT_EQ(there.frames[i].scene.SerializeAsString(), here.frames[i].scene.SerializeAsString());
    test::expect_same(there.finished[i], here.finished.at(i));
  }
  EXPECT_NE(there.finished[0].drawing.image.pixels, there.finished[2].drawing.image.pixels);
  // Passes may be left out, but those that come are of 1, 2 or 4 samples.
  ASSERT_LE(there.passes.size(), here.passes.size());
  for (const Picture& pass : there.passes) {
    EXPECT_TRUE(pass.samples_per_pixel == 1 || pass.samples_per_pixel == 2 ||
                pass.samples_per_pixel == 4);
  }
}

TEST_F(NodeTest, KeepsFabricsInMemoryAndOnDisk) {
  start();
  KeptPictures pictures;
  draw(small_scene("one@1"), false, pictures);
  draw(small_scene("one@1"), false, pictures);
  EXPECT_EQ(catalogue_->fetches(), 1);
  const v1::GetNodeResponse node = client().node();
  ASSERT_EQ(node.fabrics_size(), 1);
  EXPECT_EQ(node.fabrics(0) + ".h5", cached("one@1").filename().string());
  EXPECT_GT(node.fabrics_bytes(), 0u);
  EXPECT_EQ(node.orders(), 0u);
  start();
  draw(small_scene("one@1"), false, pictures);
  EXPECT_EQ(catalogue_->fetches(), 1);
}

TEST_F(NodeTest, FetchesADamagedCacheFileAgain) {
  start();
  KeptPictures pictures;
  draw(small_scene("one@1"), false, pictures);
  std::string bytes = core::read_file(cached("one@1"));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  core::write_file_atomically(cached("one@1"), bytes);
  start();
  draw(small_scene("one@1"), false, pictures);
  EXPECT_EQ(catalogue_->fetches(), 2);
  test::expect_same(pictures.finished.at(0), pictures.finished.at(1));
}

TEST_F(NodeTest, FetchesOnceMoreWhatCameDamaged) {
  start();
  catalogue_->damage_next_fetch();
  KeptPictures pictures;
  draw(small_scene("one@1"), false, pictures);
  EXPECT_EQ(catalogue_->fetches(), 2);
  EXPECT_EQ(pictures.finished.size(), 1u);
}

TEST_F(NodeTest, LetsTheFabricUsedLongestAgoGoFromDiskAndMemory) {
  options_.cache_limit_bytes =
      catalogue_->version("one@1").size_bytes() + catalogue_->version("two@1").size_bytes() / 2;
  start();
  KeptPictures pictures;
  draw(small_scene("one@1"), false, pictures);
  const std::uint64_t one_bytes = client().node().fabrics_bytes();
  EXPECT_TRUE(std::filesystem::exists(cached("one@1")));
  draw(small_scene("two@1"), false, pictures);
  EXPECT_FALSE(std::filesystem::exists(cached("one@1")));
  EXPECT_TRUE(std::filesystem::exists(cached("two@1")));
  EXPECT_EQ(client().node().fabrics_size(), 2);
  // Room for one of the two, and for the picture.
  options_.memory_limit_bytes = one_bytes + one_bytes / 2;
  start();
  draw(small_scene("one@1"), false, pictures);
  draw(small_scene("two@1"), false, pictures);
  ASSERT_EQ(client().node().fabrics_size(), 1);
  EXPECT_EQ(client().node().fabrics(0) + ".h5", cached("two@1").filename().string());
}

TEST_F(NodeTest, RefusesWhatDoesNotFitWithFiguresAndBeforeAnyWork) {
  options_.memory_limit_bytes = std::uint64_t{64} << 20;
  start();
  v1::Scene large = small_scene("one@1");
  large.mutable_picture()->set_width(8192);
  large.mutable_picture()->set_height(8192);
  const core::Error picture = error_of(large);
  EXPECT_EQ(picture.code(), core::Code::kResourceExhausted);
  EXPECT_NE(std::string(picture.what()).find("64 MiB"), std::string::npos) << picture.what();
  EXPECT_EQ(catalogue_->fetches(), 0);
  options_.memory_limit_bytes = std::uint64_t{1} << 16;
  start();
  EXPECT_EQ(error_of(small_scene("one@1")).code(), core::Code::kResourceExhausted);
  options_.memory_limit_bytes = std::uint64_t{1} << 30;
  options_.cache_limit_bytes = 1024;
  start();
  const core::Error fabric = error_of(small_scene("one@1"));
  EXPECT_EQ(fabric.code(), core::Code::kResourceExhausted);
  EXPECT_NE(std::string(fabric.what()).find("1024"), std::string::npos) << fabric.what();
  EXPECT_EQ(catalogue_->fetches(), 0);
}

TEST_F(NodeTest, SaysWhatItDoesNotHave) {
  start();
  EXPECT_EQ(error_of(small_scene("three@1")).code(), core::Code::kNotFound);
  catalogue_.reset();
  EXPECT_EQ(error_of(small_scene("one@1")).code(), core::Code::kUnavailable);
}

TEST_F(NodeTest, StopsWhenTheCallerGoesAway) {
  start();
  KeptPictures pictures;
  std::atomic<bool> is_drawing = false;
  pictures.on_progress = [&](double) { is_drawing = true; };
  try {
    client().draw_pictures(endless_scene("one@1"), true, files_on_disk(), pictures, {},
                           [&] { return is_drawing.load(); });
    ADD_FAILURE() << "it was drawn";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kCancelled);
  }
  while (client().node().orders() > 0) {  // the test's own time limit ends this
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  draw(small_scene("one@1"), false, pictures);
  EXPECT_EQ(pictures.finished.size(), 1u);
}

TEST_F(NodeTest, TakesNoMoreOrdersThanItsQueueHolds) {
  options_.orders_limit = 1;
  start();
  KeptPictures pictures;
  std::atomic<bool> is_drawing = false;
  std::atomic<bool> is_over = false;
  pictures.on_progress = [&](double) { is_drawing = true; };
  std::thread first([&] {
    try {
      client().draw_pictures(endless_scene("one@1"), true, files_on_disk(), pictures, {},
                             [&] { return is_over.load(); });
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kCancelled);
    }
  });
  while (!is_drawing) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(error_of(small_scene("one@1")).code(), core::Code::kResourceExhausted);
  is_over = true;
  first.join();
}

// grpc.health.v1.Health/Check for the whole server: 1 serving, 2 not serving, 0 no answer.
int health_of(const std::string& address) {
  grpc::GenericStub stub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  const grpc::Slice nothing;
  const grpc::ByteBuffer request(&nothing, 1);  // an empty message
  const auto call =
      stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", request, &queue);
  grpc::ByteBuffer response;
  grpc::Status status;
  call->StartCall();
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool is_ok = false;
  queue.Next(&tag, &is_ok);
  grpc::Slice slice;
  if (!status.ok() || !response.DumpToSingleSlice(&slice).ok() || slice.size() != 2) {
    return 0;
  }
  return slice.begin()[1];  // field 1, a small number
}

TEST_F(NodeTest, ReportsItsHealthAndDrains) {
  start();
  EXPECT_EQ(health_of(node_->address()), 1);
  node_->drain([] { return false; });
  EXPECT_EQ(health_of(node_->address()), 2);
  EXPECT_TRUE(client().node().draining());
  EXPECT_EQ(error_of(small_scene("one@1")).code(), core::Code::kUnavailable);
}

TEST_F(NodeTest, RefusesAnAddressThatOthersReach) {
  try {
    const RenderNode node(options_, security::Endpoint("0.0.0.0:0"));
    ADD_FAILURE() << "it listens at " << node.address();
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kPermissionDenied);
  }
  const RenderNode node(options_, security::Endpoint("127.0.0.1:0"));
  EXPECT_NE(node.address(), "127.0.0.1:0");
}

// Sends an order as it is and returns how the call ends.
grpc::Status status_of(const std::string& address, const v1::RenderOrder& order,
                       const std::vector<std::string>& chunks) {
  const auto stub =
      v1::RenderService::NewStub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const auto stream = stub->Render(&context);
  v1::RenderRequest request;
  *request.mutable_order() = order;
  stream->Write(request);
  for (const std::string& chunk : chunks) {
    request.set_chunk(chunk);
    stream->Write(request);
  }
  stream->WritesDone();
  v1::RenderResponse response;
  while (stream->Read(&response)) {
  }
  return stream->Finish();
}

class NodeOrderTest : public NodeTest {
 protected:
  // A flat sheet of 2 triangles, as an attachment of an order for its shell.
  static constexpr const char* kSheet =
      "v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
      "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
  static v1::RenderOrder order_of(const std::string& file) {
    v1::RenderOrder order;
    order.set_request_id("an-order");
    *order.mutable_scene() = small_scene("one@1");
    order.mutable_scene()->mutable_cloths(0)->mutable_shell()->set_obj_file(file);
    return order;
  }
  static v1::RenderOrder order_with_sheet() {
    v1::RenderOrder order = order_of("sheet.obj");
    v1::Attachment& attachment = *order.add_attachments();
    attachment.set_name("sheet.obj");
    attachment.set_size_bytes(std::string(kSheet).size());
    attachment.set_digest(core::digest_of(kSheet).binary());
    return order;
  }
};

TEST_F(NodeOrderTest, TakesFilesFromAttachmentsInAnyChunks) {
  start();
  const std::string sheet = kSheet;
  EXPECT_TRUE(status_of(node_->address(), order_with_sheet(), {sheet}).ok());
  EXPECT_TRUE(
      status_of(node_->address(), order_with_sheet(), {sheet.substr(0, 10), "", sheet.substr(10)})
          .ok());
}

TEST_F(NodeOrderTest, RefusesAttachmentsThatAreNotWhatTheOrderSays) {
  start();
  const std::string sheet = kSheet;
  std::string damaged = sheet;
  damaged[3] = '6';
  for (const std::vector<std::string>& chunks : std::vector<std::vector<std::string>>{
           {damaged}, {}, {sheet.substr(1)}, {sheet, "more"}, {std::string(2 << 20, ' ')}}) {
    const grpc::Status status = status_of(node_->address(), order_with_sheet(), chunks);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
  }
  v1::RenderOrder huge = order_with_sheet();
  huge.mutable_attachments(0)->set_size_bytes(std::uint64_t{1} << 40);
  EXPECT_EQ(status_of(node_->address(), huge, {}).error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(catalogue_->fetches(), 0);
}

TEST_F(NodeOrderTest, NeverOpensAPathOfItsOwnDisk) {
  start();
  const std::filesystem::path file = folder_ / "sheet.obj";
  core::write_file_atomically(file, kSheet);
  const grpc::Status status = status_of(node_->address(), order_of(file.string()), {});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("no attachment"), std::string::npos);
  v1::RenderOrder fabric = order_with_sheet();
  fabric.mutable_scene()->mutable_cloths(0)->set_fabric((folder_ / "one.h5").string());
  EXPECT_EQ(status_of(node_->address(), fabric, {kSheet}).error_code(),
            grpc::StatusCode::NOT_FOUND);
}

TEST_F(NodeOrderTest, RefusesOrdersThatBreakARule) {
  start();
  v1::RenderOrder order = order_with_sheet();
  order.set_request_id("no id!");
  EXPECT_EQ(status_of(node_->address(), order, {kSheet}).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  order = order_with_sheet();
  order.mutable_scene()->mutable_picture()->set_samples_per_pixel(0);
  EXPECT_EQ(status_of(node_->address(), order, {kSheet}).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  order = order_with_sheet();
  order.mutable_scene()->mutable_lights(0)->mutable_sg()->set_sharpness(-1);
  EXPECT_EQ(status_of(node_->address(), order, {kSheet}).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  order = order_with_sheet();
  *order.add_attachments() = order.attachments(0);
  EXPECT_EQ(status_of(node_->address(), order, {kSheet}).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace weft::render
