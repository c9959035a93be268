// SPDX-License-Identifier: Apache-2.0
// Reads plates: EXR as premultiplied R, G, B, A and Z, PNG (8 bits) and JPEG by a table from codes
// to light. Colours are converted to kSceneSpace: from the layer's space, or else from that of the
// file. Depth is planar, metres. Cost: linear in pixels.
#include "compose/plate_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/layers/area_scaling.h"
#include "images/exr_reader.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"

namespace raystage::compose {
namespace {

constexpr images::ExrChannel kPicture[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
constexpr const char* kFlatExr = "Give a flat EXR file with channels R, G and B";
constexpr float kInfinity = std::numeric_limits<float>::infinity();

bool is_named(const std::filesystem::path& path, std::initializer_list<const char*> extensions) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::find(extensions, extension) != extensions.end();
}

/// Light of 8-bit codes: linear light of sRGB, or shares of full scale for other colour spaces.
using CodeToLight = std::array<float, 256>;
CodeToLight make_code_to_light(bool by_srgb) {
  CodeToLight light{};
  for (std::size_t code = 0; code < light.size(); ++code) {
    const double share = static_cast<double>(code) / 255;
    light[code] = static_cast<float>(by_srgb ? linear_from_srgb(share) : share);
  }
  return light;
}

/// Clamps infinite values and NaN, which other renderers may write and "over" cannot handle.
void make_finite(LayerImage& image) {
  constexpr float kMax = 65504;  // of half
  for (float& value : image.rgba) value = std::isnan(value) ? 0.0F : std::clamp(value, -kMax, kMax);
  for (float& z : image.z) {
    if (std::isnan(z)) z = kInfinity;
  }
}

LayerImage read_jpeg_plate(const std::filesystem::path& path, const CodeToLight& light) {
  const std::string bytes = read_file(path);
  const store::RgbImage codes =
      store::JpegDecoder().decode(std::as_bytes(std::span(bytes)), path.string());
  LayerImage image = transparent_layer_image(codes.width, codes.height);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) image.rgba[4 * i + c] = light[codes.values[3 * i + c]];
    image.rgba[4 * i + 3] = 1;
  }
  return image;
}

/// Returns the size of a plate of a supported format, without reading its pixels.
std::array<int, 2> size_of(const images::ExrReader& exr, const images::ImageReader& png,
                           const std::filesystem::path& path) {
  if (is_named(path, {".exr"})) return exr.size(path, kPicture, kFlatExr);
  if (!is_named(path, {".png"})) {
    const std::string bytes = read_file(path);
    const store::JpegLayout layout =
        store::parse_jpeg_layout(std::as_bytes(std::span(bytes)), path.string());
    return {layout.width, layout.height};
  }
  const images::ImageProperties properties = png.properties(path);
  return {properties.width, properties.height};
}

LayerImage read_png_plate(const images::ImageReader& png, const std::filesystem::path& path,
                          const CodeToLight& light) {
  const images::ImageValues<std::uint8_t> codes = png.read_codes(path);  // R, G, B, A
  LayerImage image = transparent_layer_image(codes.properties.width, codes.properties.height);
  for (std::size_t i = 0; i < image.rgba.size(); i += 4) {
    const float alpha = static_cast<float>(codes.values[i + 3]) / 255;
    for (std::size_t c = 0; c < 3; ++c) image.rgba[i + c] = alpha * light[codes.values[i + c]];
    image.rgba[i + 3] = alpha;
  }
  return image;
}

}  // namespace

PlateLayer::PlateLayer(const schemas::ShotDocument& shot, std::size_t index,
                       const std::filesystem::path& folder, std::optional<ColorConfig> config,
                       double scale, std::size_t memory_bytes)
    : document_(*shot.layers[index].plate),
      width_(shot.width),
      height_(shot.height),
      scale_(scale),
      name_((folder / document_.file).lexically_normal().string()),
      config_(std::move(config)),
      exr_(memory_bytes),
      png_(images::ImageReader::of_png_plates(memory_bytes)) {
  if (!document_.space.empty()) colors().from_space(document_.space);  // throws if unknown
}

ColorConfig PlateLayer::colors() const { return config_ ? *config_ : ColorConfig::built_in(); }

std::filesystem::path PlateLayer::file(int frame) const {
  return name_.path(frame + document_.frame_offset);
}

void PlateLayer::check_file(int frame) const {
  const std::filesystem::path path = file(frame);
  if (!is_named(path, {".exr", ".png", ".jpg", ".jpeg"})) {
    throw Error::bad_input("the plate is not EXR, PNG or JPEG", path.string(),
                           "Convert it to EXR, e.g. with oiiotool IN -o OUT.exr");
  }
  if (!file_exists(path)) {
    throw Error::bad_input(fmt::format("the plate of frame {} is missing", frame), path.string(),
                           "Add it, or correct the layer's file or frame_offset");
  }
  check_size(size_of(exr_, png_, path), path);
}

void PlateLayer::check_size(const std::array<int, 2>& size,
                            const std::filesystem::path& path) const {
  const auto scaled = [this](int pixels) { return std::lround(pixels * scale_); };
  if (scaled(size[0]) == width_ && scaled(size[1]) == height_) return;
  throw Error::bad_input(fmt::format("the plate has {} x {} pixels, the shot {:.0f} x {:.0f}",
                                     size[0], size[1], width_ / scale_, height_ / scale_),
                         path.string(), "Scale it to the shot's size");
}

LayerImage PlateLayer::read(const std::filesystem::path& path) const {
  const bool by_srgb = document_.space.empty();
  if (is_named(path, {".png"})) return read_png_plate(png_, path, make_code_to_light(by_srgb));
  if (is_named(path, {".jpg", ".jpeg"})) return read_jpeg_plate(path, make_code_to_light(by_srgb));
  constexpr images::ExrChannel kDepth[] = {{"Z", kInfinity}};
  const images::ExrChannelData pixels = exr_.read(path, kPicture, kFlatExr);
  LayerImage image = transparent_layer_image(pixels.width, pixels.height);
  std::ranges::copy(pixels.values, image.rgba.begin());
  std::ranges::copy(exr_.read(path, kDepth, kFlatExr).values, image.z.begin());
  make_finite(image);
  const bool has_id = !pixels.color_interop_id.empty() && pixels.color_interop_id != "unknown";
  const std::string& space = has_id ? pixels.color_interop_id : pixels.color_space;
  if (document_.space.empty() && !space.empty() && space != kSceneSpace) {
    convert_to_scene_space(image, space);
  }
  return image;
}

void PlateLayer::convert_to_scene_space(LayerImage& image, const std::string& space) const {
  colors().from_space(space).apply(image.rgba);
}

LayerImage PlateLayer::image(int frame, int overscan_x, int overscan_y) const {
  const std::filesystem::path path = file(frame);
  LayerImage plate = read(path);
  check_size({plate.width, plate.height}, path);
  if (!document_.space.empty()) convert_to_scene_space(plate, document_.space);
  if (scale_ < 1) plate = scale_down(plate, {width_, height_});
  LayerImage image = transparent_layer_image(width_ + 2 * overscan_x, height_ + 2 * overscan_y);
  const auto depth = document_.depth_m ? static_cast<float>(*document_.depth_m) : kInfinity;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto from = static_cast<std::size_t>(y * width_ + x);
      const auto to = static_cast<std::size_t>((y + overscan_y) * image.width + x + overscan_x);
      std::copy_n(&plate.rgba[4 * from], 4, &image.rgba[4 * to]);
      const bool is_nothing = plate.rgba[4 * from + 3] == 0;
      image.z[to] = is_nothing ? kInfinity : document_.depth_m ? depth : plate.z[from];
    }
  }
  return image;
}

void PlateLayer::check_frame(const LayerFrameCheck& check) const {
  if (check.is_visible && check.files_checked.insert(file(check.frame)).second) {
    check_file(check.frame);
  }
}

std::unique_ptr<const LayerRenderer> PlateLayer::make_renderer(
    const LayerRendererOptions& /*options*/) const {
  class Renderer final : public LayerRenderer {
   public:
    explicit Renderer(const PlateLayer& layer) : layer_(layer) {}
    LayerImage render(const LayerView& view) const override {
      return layer_.image(view.frame, view.camera.overscan_x, view.camera.overscan_y);
    }

   private:
    const PlateLayer& layer_;
  };
  return std::make_unique<const Renderer>(*this);
}

void PlateLayer::add_to_fingerprint(Fingerprint& print, double frame,
                                    const ShownTick& /*shown*/) const {
  print.text("plate", read_file(file(static_cast<int>(std::lround(frame)))))
      .text("space", document_.space);
  print.number("depth", document_.depth_m.value_or(0));
}

}  // namespace raystage::compose
