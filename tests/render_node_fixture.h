#pragma once

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include "core/digest.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "render/draw_pictures.h"
#include "render/node/node_client.h"
#include "render/node/render_node.h"
#include "render/scene_description.h"
#include "tests/render_lonely_fibre.h"

// A render node and a coordinator's catalogue in this process, for the tests of render/node.
namespace weft::test {

// Serves databases as a coordinator does: "one@1", "two@1", ...; counts what is fetched.
class Catalogue final : public v1::CatalogueService::Service {
 public:
  explicit Catalogue(const std::filesystem::path& folder) : folder_(folder) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort(address(), grpc::InsecureServerCredentials());
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~Catalogue() override { server_->Shutdown(); }
  Catalogue(const Catalogue&) = delete;
  Catalogue& operator=(const Catalogue&) = delete;
  Catalogue(Catalogue&&) = delete;
  Catalogue& operator=(Catalogue&&) = delete;

  [[nodiscard]] std::string address() const { return "unix:" + (folder_ / "catalogue").string(); }

  void publish(const std::string& name, const storage::FabricDatabase& database) {
    const std::filesystem::path file = folder_ / (name + ".h5");
    v1::Version version;
    version.set_fabric(name);
    version.set_number(1);
    version.set_content_digest(storage::write_database(database, file).binary());
    version.set_size_bytes(std::filesystem::file_size(file));
    versions_[name + "@1"] = version;
  }
  [[nodiscard]] const v1::Version& version(const std::string& reference) const {
    return versions_.at(reference);
  }
  [[nodiscard]] int fetches() const { return fetches_; }
  // The next stream sends this many bytes that are not the version's.
  void damage_next_fetch() { damages_next_ = true; }

  grpc::Status GetVersion(grpc::ServerContext* /*context*/, const v1::GetVersionRequest* request,
                          v1::GetVersionResponse* response) override {
    const auto found = versions_.find(request->reference());
    if (found == versions_.end()) {
      return {grpc::StatusCode::NOT_FOUND, "no version " + request->reference()};
    }
    *response->mutable_version() = found->second;
    return grpc::Status::OK;
  }
  grpc::Status FetchVersion(grpc::ServerContext* /*context*/,
                            const v1::FetchVersionRequest* request,
                            grpc::ServerWriter<v1::FetchVersionResponse>* writer) override {
    ++fetches_;
    const v1::Version& version = versions_.at(request->reference());
    std::string bytes = core::read_file(folder_ / (version.fabric() + ".h5"));
    if (damages_next_.exchange(false)) {
      bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
    }
    v1::FetchVersionResponse response;
    response.set_data(bytes.substr(request->offset()));
    writer->Write(response);
    return grpc::Status::OK;
  }

 private:
  std::filesystem::path folder_;
  std::map<std::string, v1::Version> versions_;
  std::atomic<int> fetches_ = 0;
  std::atomic<bool> damages_next_ = false;
  std::unique_ptr<grpc::Server> server_;
};

// Keeps what is drawn; `on_progress` may do more.
class KeptPictures : public render::PictureSink {
 public:
  [[nodiscard]] bool start(const render::Frame& frame) override {
    frames.push_back(frame);
    return true;
  }
  void progress(double share_of_frame) override {
    if (on_progress) {
      on_progress(share_of_frame);
    }
  }
  void pass(const render::Frame& /*frame*/, const render::Picture& picture) override {
    passes.push_back(picture);
  }
  void finish(const render::Frame& /*frame*/, const render::Picture& picture) override {
    finished.push_back(picture);
  }

  std::vector<render::Frame> frames;
  std::vector<render::Picture> passes;
  std::vector<render::Picture> finished;
  std::function<void(double)> on_progress;
};

class NodeTest : public testing::Test {
 protected:
  NodeTest() {
    std::string name = (std::filesystem::temp_directory_path() / "weft-node-XXXXXX").string();
    EXPECT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    catalogue_ = std::make_unique<Catalogue>(folder_);
    catalogue_->publish("one", lonely_fibre(0.5f));
    catalogue_->publish("two", lonely_fibre(0.25f));
    options_.coordinator = catalogue_->address();
    options_.cache = folder_ / "cache";
    options_.threads = 2;
    options_.device = "cpu";
  }
  ~NodeTest() override {
    node_.reset();
    catalogue_.reset();
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  // Starts a node, in place of the one before.
  void start() {
    node_.reset();
    node_ = std::make_unique<render::RenderNode>(
        options_, "unix:" + (folder_ / ("node-" + std::to_string(++nodes_))).string());
  }
  [[nodiscard]] render::NodeClient client() const { return render::NodeClient(node_->address()); }

  // A few pixels of the lonely fibre, with everything that a picture may hold.
  static v1::Scene small_scene(const std::string& fabric) {
    v1::Scene scene = render::parse_scene(
        R"(camera { position { x: 1 y: 0.5 z: 8 } look_at { x: 3.2 }
                    orthographic { height_mm: 0.2 } }
           cloths { flat { size_x_mm: 10 size_y_mm: 10 centre_y_mm: -5 endless: true } }
           picture { width: 12 height: 8 samples_per_pixel: 5 })",
        "small", "");
    render::set_layers(render::LayerSet::all(), *scene.mutable_picture());
    render::complete_scene(scene, fabric);
    return scene;
  }
  // So many samples that it takes minutes unless it is stopped.
  static v1::Scene endless_scene(const std::string& fabric) {
    v1::Scene scene = small_scene(fabric);
    scene.mutable_picture()->set_width(256);
    scene.mutable_picture()->set_height(256);
    scene.mutable_picture()->set_samples_per_pixel(1U << 20);
    return scene;
  }
  // The same in this process.
  static void draw_here(const v1::Scene& scene, float transfer, bool progressive,
                        render::PictureSink& sink, render::gpu::DeviceRenderer* device = nullptr) {
    std::shared_ptr<const render::Fabric> fabric = render::Fabric::from_database(
        lonely_fibre(transfer), render::Fabric::Wanted::kFibresAndTransfer);
    render::PictureSettings settings;
    settings.progressive = progressive;
    settings.device = device;
    render::draw_pictures(
        scene, settings, [&](const std::string&) { return fabric; }, render::files_on_disk(), sink,
        [] { return false; });
  }
  void draw(const v1::Scene& scene, bool progressive, render::PictureSink& sink) const {
    client().draw_pictures(scene, progressive, render::files_on_disk(), sink, {},
                           [] { return false; });
  }
  // The error that drawing the scene ends with.
  [[nodiscard]] core::Error error_of(const v1::Scene& scene) const {
    KeptPictures pictures;
    try {
      draw(scene, false, pictures);
    } catch (const core::Error& error) {
      return error;
    }
    ADD_FAILURE() << "it was drawn";
    return {core::Code::kInternal, "drawn"};
  }
  [[nodiscard]] std::filesystem::path cached(const std::string& reference) const {
    const auto digest = core::Digest::from_binary(catalogue_->version(reference).content_digest());
    return options_.cache / "fabrics" / (digest->hex() + ".h5");
  }

  std::filesystem::path folder_;
  std::unique_ptr<Catalogue> catalogue_;
  render::RenderNodeOptions options_;
  std::unique_ptr<render::RenderNode> node_;
  int nodes_ = 0;
};

inline void expect_same(const render::Picture& a, const render::Picture& b) {
  EXPECT_EQ(a.samples_per_pixel, b.samples_per_pixel);
  EXPECT_EQ(a.drawing.image.pixels, b.drawing.image.pixels);
  EXPECT_EQ(a.drawing.standard_error.pixels, b.drawing.standard_error.pixels);
  EXPECT_EQ(a.drawing.layers.single, b.drawing.layers.single);
  EXPECT_EQ(a.drawing.layers.multiple, b.drawing.layers.multiple);
  EXPECT_EQ(a.drawing.layers.shadow, b.drawing.layers.shadow);
  EXPECT_EQ(a.drawing.layers.segment, b.drawing.layers.segment);
  EXPECT_EQ(a.drawing.layers.cloth, b.drawing.layers.cloth);
  EXPECT_EQ(a.drawing.layers.tangent, b.drawing.layers.tangent);
  EXPECT_EQ(a.drawing.layers.normal, b.drawing.layers.normal);
  EXPECT_EQ(a.drawing.cloth_mean, b.drawing.cloth_mean);
  EXPECT_EQ(a.drawing.cloth_standard_error, b.drawing.cloth_standard_error);
  EXPECT_EQ(a.drawing.cloth_share, b.drawing.cloth_share);
}

}  // namespace weft::test
