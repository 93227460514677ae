#include "render/image.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <limits>
#include <string_view>
#include <utility>

#include <ImathBox.h>
#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::render {
namespace {

constexpr std::uint64_t kFileLimitBytes = std::uint64_t{4} << 30;
constexpr const char* kColourChannels[] = {"R", "G", "B"};

// OpenEXR writes into memory, so that the file appears on disk whole or not at all.
class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : Imf::OStream("memory") {}
  void write(const char data[], int size) override {
    const auto count = static_cast<std::size_t>(size);
    bytes_.resize(std::max(bytes_.size(), position_ + count));
    std::memcpy(bytes_.data() + position_, data, count);
    position_ += count;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::size_t position_ = 0;
};

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::string_view bytes) : Imf::IStream("memory"), bytes_(bytes) {}
  bool read(char data[], int size) override {
    const auto count = static_cast<std::size_t>(size);
    if (position_ > bytes_.size() || count > bytes_.size() - position_) {
      throw core::Error(core::Code::kDataLoss, "the file ends too early");
    }
    std::memcpy(data, bytes_.data() + position_, count);
    position_ += count;
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  std::size_t position_ = 0;
};

constexpr float kLargestHalf = 65504.0f;

// A plane of the picture in the type in which it is written.
struct Plane {
  std::string name;
  Imf::PixelType type = Imf::HALF;
  std::vector<half> halves;
  std::vector<float> floats;
  std::vector<std::uint32_t> numbers;

  [[nodiscard]] Imf::Slice slice(std::uint32_t width) {
    const auto slice_of = [&](auto& values) {
      const std::size_t bytes = sizeof(values[0]);
      return Imf::Slice(type, reinterpret_cast<char*>(values.data()), bytes, bytes * width);
    };
    switch (type) {
      case Imf::HALF:
        return slice_of(halves);
      case Imf::FLOAT:
        return slice_of(floats);
      default:
        return slice_of(numbers);
    }
  }
};

Plane plane_of(std::string name, std::vector<float> values, bool as_halves) {
  Plane plane;
  plane.name = std::move(name);
  plane.type = as_halves ? Imf::HALF : Imf::FLOAT;
  if (as_halves) {
    plane.halves.reserve(values.size());
    for (const float value : values) {
      plane.halves.emplace_back(std::clamp(value, -kLargestHalf, kLargestHalf));
    }
  } else {
    plane.floats = std::move(values);
  }
  return plane;
}

std::vector<Plane> planes_of(const Image& image, bool halves) {
  std::vector<Plane> planes;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> values;
    values.reserve(image.pixels.size());
    for (const glm::vec3& pixel : image.pixels) {
      values.push_back(pixel[c]);
    }
    planes.push_back(plane_of(kColourChannels[c], std::move(values), halves));
  }
  for (const ImageChannel& channel : image.channels) {
    if (const auto* numbers = std::get_if<std::vector<std::uint32_t>>(&channel.values)) {
      CHECK_EQ(numbers->size(), image.pixels.size());
      planes.push_back({channel.name, Imf::UINT, {}, {}, *numbers});
    } else {
      const auto& floats = std::get<std::vector<float>>(channel.values);
      CHECK_EQ(floats.size(), image.pixels.size());
      planes.push_back(plane_of(channel.name, floats, halves && !channel.always_float));
    }
  }
  return planes;
}

// The channels that the three colours of a layer are read from.
std::array<std::string, 3> channels_for(const Imf::ChannelList& channels, std::string_view layer,
                                        const std::string& file_name) {
  const std::string prefix = layer.empty() ? "" : std::string(layer) + ".";
  const auto has = [&](const char* name) {
    return channels.findChannel((prefix + name).c_str()) != nullptr;
  };
  if (has("R") && has("G") && has("B")) {
    return {prefix + "R", prefix + "G", prefix + "B"};
  }
  if (has("X") && has("Y") && has("Z")) {
    return {prefix + "X", prefix + "Y", prefix + "Z"};
  }
  if (has("Y") && !has("RY")) {
    return {prefix + "Y", prefix + "Y", prefix + "Y"};
  }
  std::string names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    names += names.empty() ? channel.name() : std::string(", ") + channel.name();
  }
  throw core::Error(
      core::Code::kInvalidArgument,
      file_name + ": the picture has the channels " + names +
          (layer.empty() ? "; give one with the channels R, G, B or with Y alone"
                         : "; none of them are colours of the layer '" + std::string(layer) + "'"));
}

Image read_from(MemoryInput& input, const std::string& name, std::string_view layer) {
  Imf::InputFile file(input, 0);
  const Imath::Box2i window = file.header().dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
  const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kImageSideLimit || height > kImageSideLimit) {
    throw core::Error(core::Code::kInvalidArgument,
                      name + ": the picture is " + std::to_string(width) + " x " +
                          std::to_string(height) + " pixels; at most " +
                          std::to_string(kImageSideLimit) + " a side can be read");
  }
  Image image(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
  // One plane at a time: a frame buffer cannot name a channel twice, and grey fills all three.
  const std::array<std::string, 3> names = channels_for(file.header().channels(), layer, name);
  std::vector<float> plane(image.pixels.size());
  for (std::size_t c = 0; c < 3; ++c) {
    Imf::FrameBuffer buffer;
    buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, plane.data(), window));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    for (std::size_t i = 0; i < plane.size(); ++i) {
      image.pixels[i][static_cast<int>(c)] = plane[i];
    }
  }
  for (auto attribute = file.header().begin(); attribute != file.header().end(); ++attribute) {
    const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute.attribute());
    if (text != nullptr) {
      image.attributes[attribute.name()] = text->value();
    }
  }
  return image;
}

}  // namespace

void write_exr(const std::filesystem::path& path, const Image& image, ExrPixels pixels) {
  CHECK_EQ(image.pixels.size(), static_cast<std::size_t>(image.width) * image.height);
  CHECK(!image.pixels.empty());
  Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
  header.compression() = Imf::ZIP_COMPRESSION;
  std::vector<Plane> planes = planes_of(image, pixels == ExrPixels::kHalf);
  Imf::FrameBuffer buffer;
  for (Plane& plane : planes) {
    header.channels().insert(plane.name, Imf::Channel(plane.type));
    buffer.insert(plane.name, plane.slice(image.width));
  }
  for (const auto& [name, value] : image.attributes) {
    header.insert(name, Imf::StringAttribute(value));
  }
  MemoryOutput output;
  try {
    Imf::OutputFile file(output, header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(static_cast<int>(image.height));
  } catch (const std::exception& error) {
    throw core::Error(core::Code::kInternal,
                      path.string() + ": OpenEXR refused the picture: " + error.what());
  }
  core::write_file_atomically(path, output.bytes());
}

Image read_exr(const std::filesystem::path& path, std::string_view layer) {
  return read_exr_bytes(core::read_file(path, kFileLimitBytes), path.string(), layer);
}

Image read_exr_bytes(std::string_view bytes, const std::string& name, std::string_view layer) {
  MemoryInput input(bytes);
  try {
    return read_from(input, name, layer);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss) {
      throw;
    }
    throw core::Error(core::Code::kDataLoss, name + ": not a whole OpenEXR picture: " +
                                                 error.what() + "; make or fetch it again");
  } catch (const std::exception& error) {
    throw core::Error(core::Code::kDataLoss,
                      name + ": not an OpenEXR picture that can be read: " + error.what());
  }
}

}  // namespace weft::render
