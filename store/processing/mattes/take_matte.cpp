// SPDX-License-Identifier: Apache-2.0
// Computes the mattes of a take's frames by colour difference key, difference key or matte files,
// limited by boxes (keyers.h, clean_plate.h, box_mask.h). Each pixel is linearised, keyed in linear
// light, and stored premultiplied as 16-bit code with 16-bit alpha. The clean plate and mask of a
// camera are computed once, on first use. Cost: one key per decoded pixel.
#include "store/processing/mattes/take_matte.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/processing/mattes/box_mask.h"
#include "store/processing/mattes/clean_plate.h"
#include "store/processing/mattes/keyers.h"
#include "store/processing/mattes/matte_file.h"
#include "store/processing/mattes/transfer_function.h"

namespace raystage::store {
namespace {

using Kind = schemas::MatteSettings::Kind;

/// The inputs of a camera's matte, computed once.
struct CameraMatte {
  std::once_flag computed;
  std::optional<CleanPlate> clean_plate;
  std::vector<bool> mask;  // of visible pixels; empty: all
  int width = 0;
};

void store(const KeyedPixel& keyed, const TransferFunction& curve, std::uint16_t* rgba) {
  for (std::size_t c = 0; c < 3; ++c) {
    const float code = keyed.alpha > 0 ? curve.code(keyed.colour[c] / keyed.alpha) : 0;
    rgba[c] = static_cast<std::uint16_t>(keyed.alpha * code + 0.5F);
  }
  rgba[3] = static_cast<std::uint16_t>(keyed.alpha * 65535 + 0.5F);
}

/// The keyer of one frame, by a function from colour and position of a pixel to a KeyedPixel.
template <class KeyPixel>
class PixelKey : public FrameKeyer {
 public:
  PixelKey(const CameraMatte& camera, const TransferFunction& curve, KeyPixel key)
      : camera_(camera), curve_(curve), key_(std::move(key)) {}

  void key_row(int x, int y, std::span<std::uint16_t> rgba) const override {
    const std::size_t first =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) +
        static_cast<std::size_t>(x);
    for (std::size_t i = 0; i < rgba.size() / 4; ++i) {
      std::uint16_t* pixel = &rgba[4 * i];
      if (!camera_.mask.empty() && !camera_.mask[first + i]) {
        std::fill_n(pixel, 4, std::uint16_t{0});
        continue;
      }
      LinearColour colour;
      for (std::size_t c = 0; c < 3; ++c) colour[c] = curve_.linear(pixel[c]);
      store(key_(colour, x + static_cast<int>(i), y), curve_, pixel);
    }
  }

 private:
  const CameraMatte& camera_;
  const TransferFunction& curve_;
  KeyPixel key_;
};

template <class KeyPixel>
std::unique_ptr<const FrameKeyer> pixel_key(const CameraMatte& camera,
                                            const TransferFunction& curve, KeyPixel key) {
  return std::make_unique<PixelKey<KeyPixel>>(camera, curve, std::move(key));
}

}  // namespace

struct TakeMatte::State {
  State(const Take& of_take, const schemas::MatteSettings& by, const std::filesystem::path& folder)
      : take(of_take), settings(by), cameras(of_take.rig().cameras.size()) {
    if (!settings.clean_plate_take.empty()) {
      clean_plate_take.emplace((folder / settings.clean_plate_take).lexically_normal());
      check_empty_take();
    }
  }

  const Take& take;
  schemas::MatteSettings settings;
  MatteReader files;
  std::optional<Take> clean_plate_take;
  std::vector<int> empty_camera;  // of the empty take, for each camera
  mutable std::vector<CameraMatte> cameras;
  mutable std::once_flag curve_made;
  mutable std::optional<TransferFunction> curve;

  void check_empty_take() {
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const std::string& id = take.document().cameras[i].id;
      empty_camera.push_back(clean_plate_take->camera_index(id));
      const rig::CameraModel& model = take.rig().cameras[i].model;
      const bool same = empty_camera[i] >= 0 && of_empty(i).width() == model.width() &&
                        of_empty(i).height() == model.height();
      if (same) continue;
      throw Error::bad_input(fmt::format("the empty take has no camera {} of {}x{} pixels", id,
                                         model.width(), model.height()),
                             clean_plate_take->folder().string(),
                             "Use an empty take that was recorded with the same array");
    }
  }
  const rig::CameraModel& of_empty(std::size_t i) const {
    return clean_plate_take->rig().cameras[empty_camera[i]].model;
  }

  const CameraMatte& camera_matte(std::size_t i) const {
    CameraMatte& camera = cameras[i];
    std::call_once(camera.computed, [&] {
      camera.width = take.rig().cameras[i].model.width();
      if (!settings.keep.empty() || !settings.garbage.empty()) {
        camera.mask = compute_box_mask(take.rig().cameras[i], settings.keep, settings.garbage);
      }
      if (settings.kind != Kind::kFiles) camera.clean_plate = make_clean_plate(i);
    });
    return camera;
  }

  CleanPlate make_clean_plate(std::size_t i) const {
    if (clean_plate_take) return CleanPlate::recorded(*clean_plate_take, empty_camera[i]);
    if (settings.screen_color) {
      LinearColour colour;
      std::ranges::transform(*settings.screen_color, colour.begin(),
                             [](double light) { return static_cast<float>(light); });
      return CleanPlate(colour);
    }
    return CleanPlate::fitted(linear_frame(take, static_cast<int>(i), 0),
                              ColorDifferenceKeyer(settings),
                              take.document().cameras[i].archive + " frame 0");
  }
};

TakeMatte::TakeMatte(const Take& take, const schemas::MatteSettings& settings,
                     const std::filesystem::path& folder)
    : state_(std::make_unique<State>(take, settings, folder)) {}

TakeMatte::~TakeMatte() = default;

std::unique_ptr<const FrameKeyer> TakeMatte::make_keyer(int camera, int frame,
                                                        const CodeScale& scale) const {
  std::call_once(state_->curve_made, [&] { state_->curve.emplace(scale); });
  const TransferFunction& curve = *state_->curve;
  const CameraMatte& inputs = state_->camera_matte(static_cast<std::size_t>(camera));
  const schemas::MatteSettings& settings = state_->settings;
  if (settings.kind == Kind::kFiles) {
    const rig::CameraModel& model = state_->take.rig().cameras[camera].model;
    return pixel_key(
        inputs, curve,
        [codes = state_->files.read(matte_file(state_->take, camera, frame), model.width(),
                                    model.height()),
         width = static_cast<std::size_t>(model.width())](const LinearColour& colour, int x,
                                                          int y) {
          KeyedPixel keyed{colour, 0};
          keyed.alpha =
              static_cast<float>(
                  codes[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)]) /
              255;
          for (float& light : keyed.colour) light *= keyed.alpha;
          return keyed;
        });
  }
  const CleanPlate& empty = *inputs.clean_plate;
  if (settings.kind == Kind::kDifference) {
    return pixel_key(inputs, curve,
                     [&empty, &curve, key = DifferenceKeyer(settings)](const LinearColour& colour,
                                                                       int x, int y) {
                       const LinearColour behind = empty.at(x, y);
                       LinearColour codes, codes_behind;
                       for (std::size_t c = 0; c < 3; ++c) {
                         codes[c] = curve.srgb(colour[c]);
                         codes_behind[c] = curve.srgb(behind[c]);
                       }
                       return key(colour, codes, behind, codes_behind);
                     });
  }
  return pixel_key(
      inputs, curve,
      [&empty, key = ColorDifferenceKeyer(settings)](const LinearColour& colour, int x, int y) {
        LinearColour screen = empty.at(x, y);
        // Where the plate is not the screen's colour, the pixel is opaque.
        if (!(key.excess(screen) > 1e-4F)) return KeyedPixel{colour, 1};
        return key(colour, screen);
      });
}

std::vector<std::filesystem::path> TakeMatte::input_files(int camera, int frame) const {
  if (state_->settings.kind != Kind::kFiles) return {};
  return {matte_file(state_->take, camera, frame).path()};
}

std::size_t TakeMatte::bytes() const {
  constexpr std::size_t kBitsPerByte = 8;
  std::size_t pixels = 0;
  for (const rig::Rig::Camera& camera : state_->take.rig().cameras) {
    pixels += static_cast<std::size_t>(camera.model.width()) *
              static_cast<std::size_t>(camera.model.height());
  }
  const schemas::MatteSettings& settings = state_->settings;
  const bool boxes = !settings.keep.empty() || !settings.garbage.empty();
  return (state_->clean_plate_take ? pixels * 3 * sizeof(std::uint16_t) : 0) +
         (boxes ? pixels / kBitsPerByte : 0);
}

std::string TakeMatte::sources() const {
  std::string text;
  const auto add = [&](const Take& take, int camera, int frames) {
    const ArchiveReader& archive = take.archive(camera);
    const int count = std::min(static_cast<int>(archive.frames().size()), frames);
    for (int i = 0; i < count; ++i) text += fmt::format(" {:x}", archive.jpeg_xxh3(i));
  };
  if (state_->clean_plate_take) {
    // Clean plates depend on the photometric correction and the transfer function.
    for (const char* name : {"take.json", "rig.json"}) {
      text += read_file(state_->clean_plate_take->file(name));
    }
  }
  for (std::size_t i = 0; i < state_->cameras.size(); ++i) {
    if (state_->settings.kind == Kind::kFiles) break;
    if (state_->clean_plate_take) {
      add(*state_->clean_plate_take, state_->empty_camera[i], CleanPlate::kMaxCleanPlateFrames);
    } else if (!state_->settings.screen_color) {
      add(state_->take, static_cast<int>(i), 1);
    }
  }
  return text;
}

}  // namespace raystage::store
