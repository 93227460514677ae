#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include "coordinator/versions/carried_over.h"
#include "coordinator/versions/colourway_arrival.h"
#include "coordinator/versions/fibre_materials.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/limits.h"
#include "storage/recolouring.h"
#include "storage/user_block.h"
#include "tests/coordinator_service_fixture.h"
#include "tests/faulty_disk.h"
#include "tests/storage_test_database.h"

// Colourways whose light was carried over, from the call to the catalogue.

namespace weft::coordinator {
namespace {

using storage::RecolourableDatabase;
using testing::HasSubstr;

std::string json_of(const v1::FabricDescription& description) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  EXPECT_TRUE(google::protobuf::util::MessageToJsonString(description, &json, options).ok());
  return json;
}

v1::FabricDescription two_materials(const std::string& name) {
  v1::FabricDescription description = small_description(name);
  *description.add_materials() = description.materials(0);
  description.mutable_materials(1)->set_name("other");
  return description;
}

void put(RecolourableDatabase& all, const v1::FabricDescription& description) {
  all.database.description_json = json_of(description);
  all.database.material_names.clear();
  all.database.materials.clear();
  for (const v1::Material& material : description.materials()) {
    all.database.material_names.push_back(material.name());
    all.database.materials.push_back(fibre_material(material));
  }
}

RecolourableDatabase base_database() {
  RecolourableDatabase base{storage::small_database(), storage::small_recolouring()};
  base.recolouring.carried_over_json.clear();
  put(base, two_materials("silk"));
  return base;
}

v1::FabricDescription claret_description(const std::string& name) {
  v1::FabricDescription description = two_materials(name);
  description.mutable_materials(0)->mutable_c_tt()->set_g(0.125);
  return description;
}

// The base in another colour.
RecolourableDatabase claret(const core::Digest& base, float light = 0.5F) {
  RecolourableDatabase made = base_database();
  made.recolouring = {};
  made.recolouring.carried_over_json = carried_over_json({"silk@1", base.hex(), 0, 0, 0});
  put(made, claret_description("silk"));
  for (float& value : made.database.transfer) {
    value *= light;
  }
  storage::round_as_written(made.database);
  return made;
}

struct Written {
  core::Digest digest;
  std::string bytes;
};
Written write(const RecolourableDatabase& made, const std::filesystem::path& path) {
  const core::Digest digest = storage::write_database(made.database, made.recolouring, path);
  return {digest, core::read_file(path)};
}

core::Digest publish_base(Catalogue& catalogue, const std::filesystem::path& folder) {
  const RecolourableDatabase base = base_database();
  Publication publication;
  publication.fabric = "silk";
  publication.file = folder / "base.h5";
  publication.job = "j1";
  publication.content_digest =
      storage::write_database(base.database, base.recolouring, publication.file);
  catalogue.prepare(publication);
  return catalogue.publish(publication).content_digest;
}

std::string bytes_of(Catalogue& catalogue, const std::string& reference) {
  std::string bytes;
  catalogue.read(catalogue.find(reference), 0, [&](std::string_view part) {
    bytes += part;
    return true;
  });
  return bytes;
}

class ColourwayTest : public ServiceTest {
 protected:
  void SetUp() override {
    ServiceTest::SetUp();
    base_ = publish_base(scheduler_->catalogue(), folder_);
  }

  Written write(const RecolourableDatabase& made) {
    return coordinator::write(made, folder_ / "made.h5");
  }

  static v1::PublishColourwayRequest claim(const Written& written,
                                           const std::string& request_id = "once") {
    v1::PublishColourwayRequest request;
    request.set_request_id(request_id);
    request.set_fabric("silk");
    request.set_base("silk@1");
    request.set_comment("claret");
    request.set_content_digest(written.digest.binary());
    request.set_size_bytes(written.bytes.size());
    return request;
  }

  grpc::Status send(const v1::PublishColourwayRequest& claim, const std::string& bytes,
                    v1::Version* version = nullptr,
                    std::size_t chunk_bytes = v1::kChunkLimitBytes) {
    grpc::ClientContext context;
    v1::PublishColourwayResponse response;
    const auto writer = catalogue_->PublishColourway(&context, &response);
    writer->Write(claim);
    v1::PublishColourwayRequest part;
    for (std::size_t at = 0; at < bytes.size(); at += chunk_bytes) {
      part.set_data(bytes.substr(at, chunk_bytes));
      if (!writer->Write(part)) {
        break;
      }
    }
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (version != nullptr) {
      *version = response.version();
    }
    return status;
  }

  // Why it is refused; nothing may be left of it.
  std::string refusal(const v1::PublishColourwayRequest& claim, const std::string& bytes,
                      grpc::StatusCode code) {
    const grpc::Status status = send(claim, bytes);
    EXPECT_EQ(status.error_code(), code) << status.error_message();
    EXPECT_EQ(scheduler_->catalogue().versions("silk").size(), 1U);
    EXPECT_TRUE(std::filesystem::is_empty(folder_ / "state" / "arriving"));
    return status.error_message();
  }
  std::string refusal_of(const std::function<void(RecolourableDatabase&)>& change) {
    RecolourableDatabase made = claret(base_);
    change(made);
    const Written written = write(made);
    return refusal(claim(written), written.bytes, grpc::StatusCode::INVALID_ARGUMENT);
  }

  core::Digest base_;
};

TEST_F(ColourwayTest, WhatIsSent_IsTheNextVersion_AlsoAfterARestart) {
  const Written written = write(claret(base_));
  v1::Version version;
  const grpc::Status status = send(claim(written), written.bytes, &version, 1000);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(version.number(), 2U);
  EXPECT_EQ(version.content_digest(), written.digest.binary());
  EXPECT_EQ(version.carried_over_from(), "silk@1");
  EXPECT_EQ(version.comment(), "claret");
  EXPECT_EQ(version.parent(), 1U);
  EXPECT_EQ(version.job_id(), "");
  EXPECT_EQ(bytes_of(scheduler_->catalogue(), "silk@2"), written.bytes);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "state" / "arriving"));
  stop();
  core::write_file_atomically(folder_ / "state" / "arriving" / "7.h5", "a part of something");
  start();
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "state" / "arriving"));
  EXPECT_EQ(bytes_of(scheduler_->catalogue(), "silk"), written.bytes);
  EXPECT_EQ(scheduler_->catalogue().find("silk").carried_over_from, "silk@1");
  EXPECT_EQ(scheduler_->catalogue().find("silk@1").carried_over_from, "");
  EXPECT_EQ(scheduler_->catalogue().history("silk", 10).front().comment, "claret");
}

TEST_F(ColourwayTest, WhatIsSentAgain_IsTheSameVersion) {
  const Written one = write(claret(base_));
  v1::Version version;
  ASSERT_TRUE(send(claim(one), one.bytes, &version).ok());
  ASSERT_TRUE(send(claim(one, "twice"), one.bytes, &version).ok());
  EXPECT_EQ(version.number(), 2U) << "equal content as the latest version's";
  const Written two = write(claret(base_, 0.25F));
  ASSERT_TRUE(send(claim(two, "other"), two.bytes, &version).ok());
  EXPECT_EQ(version.number(), 3U);
  // The call is known, whatever has been published since; nothing has to be sent for it.
  ASSERT_TRUE(send(claim(one), "", &version).ok());
  EXPECT_EQ(version.number(), 2U);
  stop();
  start();
  ASSERT_TRUE(send(claim(one), one.bytes, &version).ok());
  EXPECT_EQ(version.number(), 2U);
  ASSERT_TRUE(send(claim(one, "back"), one.bytes, &version).ok());
  EXPECT_EQ(version.number(), 4U) << "going back is a step of its own";
}

TEST_F(ColourwayTest, OfAnotherName_ItIsAnotherFabric) {
  RecolourableDatabase made = claret(base_);
  put(made, claret_description("claret"));
  const Written written = write(made);
  v1::PublishColourwayRequest request = claim(written);
  EXPECT_THAT(refusal(request, written.bytes, grpc::StatusCode::INVALID_ARGUMENT),
              HasSubstr("it is named 'claret'"));
  request.set_fabric("claret");
  v1::Version version;
  ASSERT_TRUE(send(request, written.bytes, &version).ok());
  EXPECT_EQ(version.fabric(), "claret");
  EXPECT_EQ(version.number(), 1U);
  EXPECT_EQ(version.carried_over_from(), "silk@1");
}

TEST_F(ColourwayTest, WhatDiffersInMoreThanColour_IsRefused) {
  using All = RecolourableDatabase;
  EXPECT_THAT(refusal_of([](All& all) { all.database.points_mm[4] += 0.001F; }),
              HasSubstr("other fibres"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.strands[5] = 0; }), HasSubstr("other fibres"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.cell_paths[0] += 1; }),
              HasSubstr("other cells"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.ssdf[3] ^= 1; }),
              HasSubstr("other visibility"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.stages_json = "{}"; }),
              HasSubstr("other results"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.materials[0].c_tt.x = 0.25F; }),
              HasSubstr("not as its description says"));
  const auto described = [](const std::function<void(v1::FabricDescription&)>& change) {
    return [change](All& all) {
      v1::FabricDescription description = claret_description("silk");
      change(description);
      put(all, description);
    };
  };
  EXPECT_THAT(refusal_of(described([](auto& d) { d.mutable_materials(0)->set_beta_r_deg(7); })),
              HasSubstr("yarns[0].material"));
  EXPECT_THAT(refusal_of(described([](auto& d) { d.mutable_materials(1)->set_beta_r_deg(7); })),
              HasSubstr("in other directions"));
  EXPECT_THAT(refusal_of(described([](auto& d) { d.set_seed(2); })), HasSubstr("seed"));
  EXPECT_THAT(refusal_of(described([](auto& d) { d.mutable_materials(0)->clear_name(); })),
              HasSubstr("name"));
  EXPECT_THAT(refusal_of(described([](auto& d) { d.mutable_weave()->set_wif_file("a.wif"); })),
              HasSubstr("names a file"));
  EXPECT_THAT(refusal_of([](All& all) { all.database.description_json = "{"; }),
              HasSubstr("none of this weft"));
}

TEST_F(ColourwayTest, WhatIsNotOfTheBase_IsRefused) {
  using All = RecolourableDatabase;
  const auto says = [](const CarriedOver& carried) {
    return [carried](All& all) { all.recolouring.carried_over_json = carried_over_json(carried); };
  };
  const core::Digest other = core::digest_of("other");
  EXPECT_THAT(refusal_of(says({"silk@1", other.hex(), 0, 0, 0})), HasSubstr("that version has"));
  EXPECT_THAT(refusal_of(says({"wool@1", base_.hex(), 0, 0, 0})), HasSubstr("from 'wool@1'"));
  EXPECT_THAT(refusal_of([](All& all) { all.recolouring.carried_over_json.clear(); }),
              HasSubstr("does not say"));
  EXPECT_THAT(refusal_of([](All& all) {
                const std::string text = all.recolouring.carried_over_json;
                all.recolouring = storage::small_recolouring();
                all.recolouring.carried_over_json = text;
              }),
              HasSubstr("orders of scattering"));

  const Written written = write(claret(base_));
  v1::PublishColourwayRequest request = claim(written);
  request.set_base("silk@9");
  EXPECT_THAT(refusal(request, written.bytes, grpc::StatusCode::NOT_FOUND),
              HasSubstr("no version 9"));
  request.set_base("silk");
  EXPECT_THAT(refusal(request, written.bytes, grpc::StatusCode::INVALID_ARGUMENT),
              HasSubstr("another version later"));
  // A colourway is nobody's base.
  ASSERT_TRUE(send(claim(written), written.bytes).ok());
  RecolourableDatabase second = claret(base_, 0.25F);
  second.recolouring.carried_over_json =
      carried_over_json({"silk@2", written.digest.hex(), 0, 0, 0});
  const Written of_colourway = write(second);
  request = claim(of_colourway, "second");
  request.set_base("silk@2");
  const grpc::Status status = send(request, of_colourway.bytes);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("a colourway itself"));
}

TEST_F(ColourwayTest, WhatIsNotWhatWasAnnounced_IsRefused) {
  const Written written = write(claret(base_));
  const auto bytes_refused = [&](const std::string& bytes) {
    return refusal(claim(written), bytes, grpc::StatusCode::DATA_LOSS);
  };
  EXPECT_THAT(bytes_refused(written.bytes.substr(0, written.bytes.size() - 1)),
              HasSubstr("nothing was published"));
  EXPECT_THAT(bytes_refused(""), HasSubstr("0 of the colourway's"));
  EXPECT_THAT(bytes_refused(written.bytes + "x"), HasSubstr("more bytes"));
  std::string flipped = written.bytes;
  flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 1);
  EXPECT_THAT(bytes_refused(flipped), HasSubstr("damaged"));
  // No database, under a digest that holds.
  Written noise{core::digest_of(std::string(5000, 'x')), ""};
  noise.bytes = storage::encode_user_block({storage::kDatabaseSchema, 5512, noise.digest}) +
                std::string(5000, 'x');
  (void)refusal(claim(noise), noise.bytes, grpc::StatusCode::DATA_LOSS);

  v1::PublishColourwayRequest large = claim(written);
  large.set_size_bytes(3 * written.bytes.size() + (std::uint64_t{4} << 20));
  EXPECT_THAT(refusal(large, "", grpc::StatusCode::RESOURCE_EXHAUSTED),
              HasSubstr("colourway_bytes_limit"));
  v1::PublishColourwayRequest chunk = claim(written);
  chunk.set_size_bytes(v1::kChunkLimitBytes + 1);
  chunk.set_data(std::string(v1::kChunkLimitBytes + 1, 'x'));
  EXPECT_THAT(refusal(chunk, "", grpc::StatusCode::INVALID_ARGUMENT), HasSubstr("1 MiB"));
  v1::PublishColourwayRequest unnamed = claim(written);
  unnamed.clear_request_id();
  EXPECT_THAT(refusal(unnamed, "", grpc::StatusCode::INVALID_ARGUMENT), HasSubstr("request_id"));
  v1::PublishColourwayRequest path = claim(written);
  path.set_fabric("../silk");
  EXPECT_THAT(refusal(path, "", grpc::StatusCode::INVALID_ARGUMENT), HasSubstr("fabric's name"));
}

TEST_F(ColourwayTest, AnUploadThatBreaksOff_LeavesNothing_AndOthersWait) {
  const Written written = write(claret(base_));
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientWriter<v1::PublishColourwayRequest>>> writers;
  std::vector<v1::PublishColourwayResponse> responses(v1::kColourwaysPerConnectionLimit);
  const auto arriving = [&] {
    const std::filesystem::directory_iterator files(folder_ / "state" / "arriving");
    return std::distance(begin(files), end(files));
  };
  for (v1::PublishColourwayResponse& response : responses) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    writers.push_back(catalogue_->PublishColourway(contexts.back().get(), &response));
    v1::PublishColourwayRequest request = claim(written, "held-" + std::to_string(writers.size()));
    request.set_data(written.bytes.substr(0, 1000));
    ASSERT_TRUE(writers.back()->Write(request));
  }
  while (arriving() < v1::kColourwaysPerConnectionLimit) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const grpc::Status status = send(claim(written), written.bytes);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("colourways_per_connection_limit"));
  for (std::size_t i = 0; i < writers.size(); ++i) {
    contexts[i]->TryCancel();
    EXPECT_FALSE(writers[i]->Finish().ok());
  }
  while (arriving() > 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_EQ(scheduler_->catalogue().versions("silk").size(), 1U);
}

// The catalogue alone, on a disk that fails.
class ColourwayFaults : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = make_fault_folder("colourway");
    ASSERT_FALSE(folder_.empty());
    open(folder_ / "base");
    base_ = publish_base(*catalogue_, folder_ / "base");
    old_ = bytes_of(*catalogue_, "silk@1");
    close();
    made_ = write(claret(base_), folder_ / "made.h5");
  }
  void TearDown() override {
    close();
    std::filesystem::remove_all(folder_);
  }

  void open(const std::filesystem::path& state) {
    std::filesystem::create_directories(state);
    journal_ = std::make_unique<Journal>(state / "journal.db");
    catalogue_ = std::make_unique<Catalogue>(*journal_, state);
  }
  void close() {
    catalogue_.reset();
    journal_.reset();
  }
  VersionRecord publish() {
    ColourwayClaim claim;
    claim.order = CatalogueOrder{"once", "ada", "claret", 7};
    claim.fabric = "silk";
    claim.base = "silk@1";
    claim.content_digest = made_.digest;
    claim.size_bytes = made_.bytes.size();
    ColourwayArrival arrival(*catalogue_, claim);
    arrival.add(made_.bytes);
    return arrival.publish();
  }

  void play(std::uint64_t nth, bool loses_power) {
    const std::filesystem::path state = folder_ / "run";
    std::filesystem::remove_all(state);
    std::filesystem::copy(folder_ / "base", state, std::filesystem::copy_options::recursive);
    disk_.disarm();
    disk_.forget();
    open(state);
    disk_.arm(nth, FaultyDisk::Fault::kPowerLoss);
    try {
      (void)publish();
    } catch (const core::Error&) {
    }
    ASSERT_TRUE(disk_.has_struck()) << nth;
    close();
    if (loses_power) {
      disk_.reboot(nth);
    }
    disk_.forget();
    disk_.disarm();
    open(state);
    // All of it or nothing; and the call that is repeated is carried out once.
    const std::size_t versions = catalogue_->versions("silk").size();
    if (versions == 2) {
      EXPECT_EQ(bytes_of(*catalogue_, "silk@2"), made_.bytes) << nth;
    }
    EXPECT_EQ(publish().number, 2U) << nth;
    EXPECT_EQ(catalogue_->versions("silk").size(), 2U) << nth;
    EXPECT_EQ(catalogue_->find("silk").carried_over_from, "silk@1") << nth;
    EXPECT_EQ(bytes_of(*catalogue_, "silk@2"), made_.bytes) << nth;
    EXPECT_EQ(bytes_of(*catalogue_, "silk@1"), old_) << nth;
    EXPECT_TRUE(std::filesystem::is_empty(state / "arriving")) << nth;
    close();
  }

  std::filesystem::path folder_;
  FaultyDisk disk_;
  std::unique_ptr<Journal> journal_;
  std::unique_ptr<Catalogue> catalogue_;
  core::Digest base_;
  std::string old_;
  Written made_;
};

TEST_F(ColourwayFaults, KilledAtAnyOperation_ThereIsAWholeVersionOrNone) {
  std::filesystem::copy(folder_ / "base", folder_ / "count",
                        std::filesystem::copy_options::recursive);
  open(folder_ / "count");
  disk_.disarm();
  (void)publish();
  const std::uint64_t operations = disk_.count();
  close();
  ASSERT_GT(operations, 10U);
  RecordProperty("operations", static_cast<int>(operations));
  for (std::uint64_t nth = 1; nth <= operations && !HasFatalFailure(); ++nth) {
    play(nth, nth % 2 == 0);
  }
}

}  // namespace
}  // namespace weft::coordinator
