#include "render/node/drawing_message.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "core/check.h"
#include "core/error.h"
#include "proto/limits.h"

namespace weft::render {
namespace {

static_assert(std::endian::native == std::endian::little, "planes travel as they lie in memory");

std::size_t bytes_per_pixel(v1::PicturePlane plane) {
  switch (plane) {
    case v1::PICTURE_PLANE_SHADOW:
    case v1::PICTURE_PLANE_SEGMENT:
    case v1::PICTURE_PLANE_CLOTH:
      return 4;
    default:
      return sizeof(glm::vec3);
  }
}

// The vector of `drawing` that a plane is; `visit` takes it by reference.
template <class AnyDrawing, class Visit>
void visit_plane(AnyDrawing& drawing, v1::PicturePlane plane, Visit&& visit) {
  switch (plane) {
    case v1::PICTURE_PLANE_COLOUR:
      return visit(drawing.image.pixels);
    case v1::PICTURE_PLANE_STANDARD_ERROR:
      return visit(drawing.standard_error.pixels);
    case v1::PICTURE_PLANE_SINGLE:
      return visit(drawing.layers.single);
    case v1::PICTURE_PLANE_MULTIPLE:
      return visit(drawing.layers.multiple);
    case v1::PICTURE_PLANE_SHADOW:
      return visit(drawing.layers.shadow);
    case v1::PICTURE_PLANE_SEGMENT:
      return visit(drawing.layers.segment);
    case v1::PICTURE_PLANE_CLOTH:
      return visit(drawing.layers.cloth);
    case v1::PICTURE_PLANE_TANGENT:
      return visit(drawing.layers.tangent);
    default:
      return visit(drawing.layers.normal);
  }
}

std::vector<v1::PicturePlane> planes_of(LayerSet layers) {
  std::vector<v1::PicturePlane> planes = {v1::PICTURE_PLANE_COLOUR,
                                          v1::PICTURE_PLANE_STANDARD_ERROR};
  const auto add_if = [&](Layer layer, v1::PicturePlane plane) {
    if (layers.has(layer)) {
      planes.push_back(plane);
    }
  };
  add_if(Layer::kSingle, v1::PICTURE_PLANE_SINGLE);
  add_if(Layer::kMultiple, v1::PICTURE_PLANE_MULTIPLE);
  add_if(Layer::kShadow, v1::PICTURE_PLANE_SHADOW);
  add_if(Layer::kSegment, v1::PICTURE_PLANE_SEGMENT);
  add_if(Layer::kSegment, v1::PICTURE_PLANE_CLOTH);
  add_if(Layer::kTangent, v1::PICTURE_PLANE_TANGENT);
  add_if(Layer::kNormal, v1::PICTURE_PLANE_NORMAL);
  return planes;
}

glm::dvec3 triple(const google::protobuf::RepeatedField<double>& values) {
  return values.size() == 3 ? glm::dvec3(values[0], values[1], values[2]) : glm::dvec3(0);
}

}  // namespace

v1::PictureHeader header_of(const Picture& picture, bool finished) {
  const Drawing& drawing = picture.drawing;
  v1::PictureHeader header;
  header.set_width(drawing.image.width);
  header.set_height(drawing.image.height);
  header.set_samples_per_pixel(picture.samples_per_pixel);
  header.set_finished(finished);
  for (const v1::PicturePlane plane : planes_of(LayerSet::all())) {
    visit_plane(drawing, plane, [&](const auto& values) {
      if (!values.empty()) {
        header.add_planes(plane);
      }
    });
  }
  for (int c = 0; c < 3; ++c) {
    header.add_cloth_mean(drawing.cloth_mean[c]);
    header.add_cloth_standard_error(drawing.cloth_standard_error[c]);
  }
  header.set_cloth_share(drawing.cloth_share);
  header.set_mean_samples(drawing.mean_samples);
  header.set_load_seconds(picture.load_seconds);
  header.set_draw_seconds(picture.draw_seconds);
  header.set_device(picture.device);
  return header;
}

bool send_planes(const Drawing& drawing, const v1::PictureHeader& header,
                 const std::function<bool(std::string)>& send) {
  bool goes_on = true;
  for (const int plane : header.planes()) {
    visit_plane(drawing, static_cast<v1::PicturePlane>(plane), [&](const auto& values) {
      const auto bytes = std::as_bytes(std::span(values));
      const auto* data = reinterpret_cast<const char*>(bytes.data());
      for (std::size_t at = 0; at < bytes.size() && goes_on; at += v1::kChunkLimitBytes) {
        goes_on = send(std::string(data + at, std::min(v1::kChunkLimitBytes, bytes.size() - at)));
      }
    });
  }
  return goes_on;
}

PictureReceiver::PictureReceiver(const v1::PictureHeader& header, const DrawSettings& wanted)
    : header_(header) {
  const std::vector<v1::PicturePlane> planes = planes_of(wanted.layers);
  const bool same_planes =
      std::equal(planes.begin(), planes.end(), header.planes().begin(), header.planes().end());
  if (header.width() != wanted.width || header.height() != wanted.height || !same_planes ||
      header.samples_per_pixel() == 0 || header.samples_per_pixel() > wanted.samples_per_pixel) {
    throw core::Error(core::Code::kDataLoss,
                      "the node sends another picture than was ordered; is it of this version?");
  }
  std::size_t bytes = 0;
  for (const v1::PicturePlane plane : planes) {
    bytes += bytes_per_pixel(plane) * header.width() * header.height();
  }
  bytes_.resize(bytes);
}

void PictureReceiver::add(const std::string& chunk) {
  if (chunk.size() > bytes_.size() - received_bytes_) {
    throw core::Error(core::Code::kDataLoss, "the node sends more bytes than the picture has");
  }
  std::memcpy(bytes_.data() + received_bytes_, chunk.data(), chunk.size());
  received_bytes_ += chunk.size();
}

Picture PictureReceiver::picture() const {
  CHECK(complete());
  Picture picture;
  Drawing& drawing = picture.drawing;
  drawing.image = Image(header_.width(), header_.height());
  drawing.standard_error = Image(header_.width(), header_.height());
  const std::size_t pixels = drawing.image.pixels.size();
  std::size_t at = 0;
  for (const int plane : header_.planes()) {
    visit_plane(drawing, static_cast<v1::PicturePlane>(plane), [&](auto& values) {
      values.resize(pixels);
      const std::size_t bytes = pixels * sizeof(values[0]);
      std::memcpy(static_cast<void*>(values.data()), bytes_.data() + at, bytes);
      at += bytes;
    });
  }
  drawing.cloth_mean = triple(header_.cloth_mean());
  drawing.cloth_standard_error = triple(header_.cloth_standard_error());
  drawing.cloth_share = header_.cloth_share();
  drawing.mean_samples = header_.mean_samples();
  picture.samples_per_pixel = header_.samples_per_pixel();
  picture.load_seconds = header_.load_seconds();
  picture.draw_seconds = header_.draw_seconds();
  picture.device = header_.device();
  return picture;
}

}  // namespace weft::render
