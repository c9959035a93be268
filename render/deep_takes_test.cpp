// SPDX-License-Identifier: Apache-2.0
// Takes of more than 8 bits through every method. Each is compared with the take of 8 bits that has
// the same light, or a sixteenth of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "base/transfer_function.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "schemas/rig_document.h"
#include "store/jpegxl/picture_codec.h"
#include "store/pixel_light.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_matte.h"

namespace raystage::render {
namespace {

using schemas::PixelEncoding;

constexpr int kTakeWidth = 96, kTakeHeight = 72, kBorder = 4;

/// Writes a take of the same frames with the linear light of their codes times `gain`.
void write_deep_copy(const store::Take& from, const std::filesystem::path& folder,
                     PixelEncoding encoding, double gain) {
  schemas::TakeDocument document = from.document();
  encoding.peak = gain;
  for (auto& camera : document.cameras) camera.pixels = encoding;
  store::TakeWriter writer(folder, document, schemas::read_rig(from.file("rig.json")));
  const store::PictureCodec codec;
  for (int camera = 0; camera < from.camera_count(); ++camera) {
    const store::RgbImage codes = store::JpegDecoder().decode(from.archive(camera).jpeg(0), "");
    store::DeepPicture picture{codes.width, codes.height, {}};
    for (const std::uint8_t code : codes.values) {
      picture.samples.push_back(
          store::sample_from_light(encoding, gain * linear_from_srgb(code / 255.0)));
    }
    writer.archive(camera).append(codec.encode(picture, encoding, {}, folder), 0);
  }
  writer.commit();
}

class DeepTakes : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, kTakeWidth, kTakeHeight);
    settings.depth_range = schemas::DepthRange{3, 5};
    write_synthetic_take(settings, path("take"));
  }
  std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }

  RenderedView render(const std::string& name, bool reference = false,
                      store::BlendSpace space = store::BlendSpace::kPerceptual) const {
    const store::Take take(path(name));
    if (GetParam() == "visual_hull") {
      for (const auto& camera : take.document().cameras) {
        std::vector<std::uint8_t> codes(std::size_t{kTakeWidth} * kTakeHeight, 255);
        testing::write_matte(take.folder(), camera.id, 0, kTakeWidth, kTakeHeight, codes);
      }
    }
    RendererOptions options;
    options.reference = reference;
    options.blend_space = space;
    options.measure_confidence = true;
    rig::Pose pose;
    pose.position = {0.02, 0.01, 0};
    const VirtualCamera view = virtual_camera_with_fov(64, 48, 0.7, pose);
    return LightFieldRenderer(take, options)
        .render(view, store::select_frames(take, 0, 1),
                {GetParam(), {0, 0, 1, 4}, {}, schemas::HoleFill::kNone});
  }

  /// Returns the share of pixels whose light is `gain` times that of `expected`, within a relative
  /// error; pixels that one of the two does not show count as wrong.
  static double share_alike(const RenderedView& expected, const RenderedView& found, double gain,
                            double error) {
    int alike = 0, count = 0;
    for (int y = kBorder; y < expected.height - kBorder; ++y) {
      for (int x = kBorder; x < expected.width - kBorder; ++x) {
        const float *a = &expected.rgba[4 * expected.index(x, y)],
                    *b = &found.rgba[4 * found.index(x, y)];
        bool is_alike = (a[3] > 0) == (b[3] > 0);
        for (std::size_t c = 0; c < 3; ++c) {
          const double wanted = gain * double{a[c]};
          is_alike = is_alike && std::isfinite(b[c]) &&
                     std::abs(double{b[c]} - wanted) <= error * (wanted + 0.01 * gain);
        }
        alike += is_alike ? 1 : 0;
        ++count;
      }
    }
    return 1.0 * alike / count;
  }

  testing::TestFolder folder_;
};

TEST_P(DeepTakes, SixteenBitsOfTheSameCodesGiveTheSamePicture) {
  write_deep_copy(store::Take(path("take")), path("deep"),
                  {PixelEncoding::Samples::kInteger, 16, PixelEncoding::Transfer::kSrgb, {}, 1}, 1);
  const RenderedView expected = render("take"), found = render("deep");
  EXPECT_GT(share_alike(expected, found, 1, 1e-3), 0.999);
  EXPECT_EQ(expected.confidence.size(), found.confidence.size());
}

TEST_P(DeepTakes, LightAboveWhiteIsKept) {
  constexpr double kGain = 16;
  write_deep_copy(store::Take(path("take")), path("deep"), {}, kGain);
  const RenderedView expected = render("take"), found = render("deep");
  EXPECT_GT(*std::ranges::max_element(found.rgba), 4.0F);
  // Samples are blended on a slightly other scale, and matched by other codes.
  EXPECT_GT(share_alike(expected, found, kGain, 0.05), 0.97);
  EXPECT_GT(share_alike(render("take", false, store::BlendSpace::kLinear),
                        render("deep", false, store::BlendSpace::kLinear), kGain, 0.05),
            0.97);
}

TEST_P(DeepTakes, AgreesWithTheReference) {
  if (GetParam() == "auto") return;  // its choice is that of the chosen method
  write_deep_copy(store::Take(path("take")), path("deep"), {}, 16);
  EXPECT_GT(share_alike(render("deep", true), render("deep"), 1, 5e-3), 0.98);
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const Method* method : methods()) names.emplace_back(method->name());
  return names;
}

INSTANTIATE_TEST_SUITE_P(Methods, DeepTakes, ::testing::ValuesIn(method_names()),
                         [](const auto& method) { return method.param; });

}  // namespace
}  // namespace raystage::render
