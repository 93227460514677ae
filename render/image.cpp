#include "render/image.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <string_view>
#include <utility>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/input_file.h"
#include "core/sandbox.h"
#include "render/files/exr_parser.h"

namespace weft::render {
namespace {

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

namespace {

Image read_apart(const core::InputFile& file, std::string_view layer) {
  if (file.size_bytes() > kExrLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      file.name() + " is larger than the limit of " +
                          std::to_string(kExrLimitBytes) + " bytes of a picture");
  }
  const std::uint64_t pixels = exr_pixel_limit(file.size_bytes());
  core::SandboxLimits limits;
  // Three colours, the channel that is being read, and what OpenEXR unfolds at a time.
  limits.memory_bytes = file.size_bytes() + pixels * 16 + (std::uint64_t{256} << 20);
  limits.answer_bytes = file.size_bytes() + pixels * 12 + (std::uint64_t{1} << 20);
  limits.cpu_s = 20 + pixels / (std::uint64_t{1} << 20);
  const core::SandboxAnswer answer =
      core::read_in_sandbox(file, {kExrRequest, file.name(), std::string(layer)}, limits);
  return image_from(core::FlatReader(answer.bytes()));
}

}  // namespace

Image read_exr(const std::filesystem::path& path, std::string_view layer) {
  return read_apart(core::InputFile(path), layer);
}

Image read_exr_bytes(std::string_view bytes, const std::string& name, std::string_view layer) {
  return read_apart(core::InputFile(bytes, name), layer);
}

}  // namespace weft::render
