// SPDX-License-Identifier: Apache-2.0
// Whole commands on takes of more than 8 bits, and programs that are not ours.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/half_float.h"
#include "exports/source_frames.h"
#include "images/exr_reader.h"
#include "render/renderer.h"
#include "schemas/views_document.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/cli/test_command.h"
#include "testing/test_folder.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// The simulated stage with lamps 64 times as bright as white, recorded as half floats ("take") and
/// as JPEG ("jpeg"), with the light of a view ("take/truth/VIEW.light.exr").
class DeepTakeCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string scene =
        "simulate still --rows 3 --columns 3 --width 96 --height 72 --seconds 0.2 "
        "--startup-loss-seconds 0 --drop 0 --noise 0 --truth-views 1 --truth-samples 16 "
        "--edge-samples 16 -q --hdr ";
    CommandResult made = run_raystage(scene + "-o " + quoted("take"));
    ASSERT_EQ(made.exit_code, 0) << made.output;
    made = run_raystage(scene + "--bits 8 -o " + quoted("jpeg"));
    ASSERT_EQ(made.exit_code, 0) << made.output;
    made = run_raystage("sync -q " + quoted("take"));
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  std::string quoted(const std::string& name) const { return "'" + path(name).string() + "'"; }

  /// Renders the view of the truth; returns R, G, B.
  images::ExrChannelData render_view(const std::string& name) const {
    const schemas::ViewsDocument views = schemas::read_views(path("take") / "views.json");
    const render::VirtualCamera view =
        render::virtual_camera_from_geometry(views.views.at(0).geometry);
    const store::Take take(path(name));
    const render::RenderedView image = render::LightFieldRenderer(take, {}).render(
        view, store::select_frames(take, views.views.at(0).time_ns, 1'000'000'000),
        {"depth", {0, 0, 0, 1}});
    images::ExrChannelData result;
    result.width = image.width;
    result.height = image.height;
    for (std::size_t i = 0; i < image.rgba.size(); ++i) {
      if (i % 4 != 3) result.values.push_back(image.rgba[i]);
    }
    return result;
  }
  static images::ExrChannelData read(const fs::path& file) {
    constexpr images::ExrChannel kChannels[]{{"R"}, {"G"}, {"B"}};
    return images::read_exr_channels(file, kChannels, "");
  }

  TestFolder folder_;
};

/// Returns the values of pixels of `wanted` that are bright, as are all their neighbours, and those
/// of `found` there.
std::vector<std::pair<double, double>> highlights(const images::ExrChannelData& wanted,
                                                  const images::ExrChannelData& found) {
  constexpr float kBright = 8;
  std::vector<std::pair<double, double>> values;
  const auto at = [&](int x, int y) { return 3 * (y * wanted.width + x); };
  for (int y = 1; y + 1 < wanted.height; ++y) {
    for (int x = 1; x + 1 < wanted.width; ++x) {
      bool is_inside = true;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          is_inside = is_inside && wanted.values[at(x + dx, y + dy)] > kBright;
        }
      }
      if (is_inside) values.emplace_back(wanted.values[at(x, y)], found.values[at(x, y)]);
    }
  }
  return values;
}

TEST_F(DeepTakeCommand, HighlightsKeepTheirLightWhereJpegClips) {
  const std::string view = schemas::read_views(path("take") / "views.json").views.at(0).geometry.id;
  const images::ExrChannelData truth = read(path("take") / "truth" / (view + ".light.exr"));
  const images::ExrChannelData deep = render_view("take"), clipped = render_view("jpeg");
  const auto kept = highlights(truth, deep), lost = highlights(truth, clipped);
  ASSERT_GE(kept.size(), 2U);
  for (const auto& [wanted, found] : kept) {
    EXPECT_GT(wanted, 40);
    EXPECT_NEAR(found, wanted, 0.03 * wanted);
  }
  for (const auto& [wanted, found] : lost) EXPECT_LE(found, 1.01);

  // The EXR of a command holds them, too.
  const CommandResult rendered =
      run_raystage("render " + quoted("take/shot.json") + " --frames 1 --progress none -o " +
                   quoted("f.####.exr"));
  ASSERT_EQ(rendered.exit_code, 0) << rendered.output;
  EXPECT_GT(std::ranges::max(read(path("f.0001.exr")).values), 30);
}

TEST_F(DeepTakeCommand, InfoVerifyPackAndRepairTreatThem) {
  const CommandResult info = run_raystage("info " + quoted("take"));
  EXPECT_THAT(info.output, HasSubstr("Pixels      JPEG XL, half floats of linear light; up to 64"));
  const auto json = nlohmann::json::parse(run_raystage("info --json " + quoted("take")).output);
  EXPECT_EQ(json["cameras"][0]["pixels"]["bits"], 16);
  EXPECT_EQ(json["cameras"][0]["pixels"]["samples"], "half");
  EXPECT_EQ(run_raystage("verify --decode -q " + quoted("take")).exit_code, 0);
  const CommandResult packed =
      run_raystage("pack -q " + quoted("take") + " -o " + quoted("packed"));
  ASSERT_EQ(packed.exit_code, 0) << packed.output;
  EXPECT_THAT(packed.output, HasSubstr("stay as they are: pictures of more than 8 bits are JPEG"));
  EXPECT_THAT(packed.output, ::testing::Not(HasSubstr("MB/s"))) << "nothing was compressed";
  const CommandResult unpacked =
      run_raystage("unpack -q " + quoted("packed") + " -o " + quoted("unpacked"));
  EXPECT_EQ(unpacked.exit_code, 2);
  EXPECT_THAT(unpacked.output, HasSubstr("JPEG XL pictures of more than 8 bits, as they were"));
  const store::Take take(path("take"));
  const std::string archive = take.document().cameras[4].archive;
  EXPECT_EQ(read_file(path("packed") / archive), read_file(path("take") / archive));
  EXPECT_EQ(run_raystage("verify -q " + quoted("packed")).exit_code, 0);

  std::string bytes = read_file(path("packed") / archive);
  bytes[static_cast<std::size_t>(take.archive(4).frames()[1].offset) + 100] ^= 1;
  write_file_atomically(path("packed") / archive, bytes);
  EXPECT_EQ(run_raystage("verify -q " + quoted("packed")).exit_code, 1);
  const CommandResult repaired =
      run_raystage("repair -q " + quoted("packed") + " --from " + quoted("take"));
  EXPECT_EQ(repaired.exit_code, 0) << repaired.output;
  EXPECT_EQ(read_file(path("packed") / archive), read_file(path("take") / archive));
}

TEST_F(DeepTakeCommand, EvaluationComparesLightAboveWhite) {
  const auto errors_of = [&](const std::string& name, const std::string& options) {
    const CommandResult evaluated =
        run_raystage("evaluate " + quoted(name) + " " + options + " --method depth --json " +
                     quoted(name + ".json"));
    EXPECT_EQ(evaluated.exit_code, 0) << evaluated.output;
    EXPECT_THAT(evaluated.output, HasSubstr("linear light, not clipped at white"));
    return nlohmann::json::parse(read_file(path(name + ".json")))["mean"]["light"];
  };
  const auto deep = errors_of("take", quoted("take/views.json"));
  const auto clipped = errors_of("jpeg", quoted("jpeg/views.json"));
  EXPECT_GT(deep["highlight_share"], 0.0005);
  EXPECT_LT(deep["highlight_rms_stops"].get<double>() + 1,
            clipped["highlight_rms_stops"].get<double>());
  EXPECT_GT(deep["pu_psnr_db"].get<double>(), clipped["pu_psnr_db"].get<double>() + 1);
  // A camera's own frames are a truth, too.
  EXPECT_GT(errors_of("take", "--exclude-cameras r1c1 --view-step 10")["highlight_share"], 0.0005);
}

TEST_F(DeepTakeCommand, RetimedTakesKeepTheirBits) {
  for (const std::string method : {"nearest", "blend", "flow"}) {
    SCOPED_TRACE(method);
    const CommandResult retimed =
        run_raystage("sync -q --retime " + method + " " + quoted("take") + " -o " + quoted(method));
    ASSERT_EQ(retimed.exit_code, 0) << retimed.output;
    EXPECT_EQ(run_raystage("verify --decode -q " + quoted(method)).exit_code, 0);
    const store::Take take(path(method)), source(path("take"));
    EXPECT_EQ(take.document().cameras[0].pixels, source.document().cameras[0].pixels);
    // The lamps keep their light. Nothing moves: interpolated frames are those of the source, but
    // for the rounding to 65536 levels.
    const store::DeepPicture picture = take.archive(4).picture(1);
    const store::DeepPicture original = source.archive(4).picture(1);
    ASSERT_EQ(picture.samples.size(), original.samples.size());
    double brightest = 0, largest = 0;
    for (std::size_t i = 0; i < picture.samples.size(); ++i) {
      const double light = float_from_half(picture.samples[i]);
      const double wanted = float_from_half(original.samples[i]);
      brightest = std::max(brightest, light);
      largest = std::max(largest, std::abs(light - wanted) / (wanted + 0.001));
    }
    EXPECT_GT(brightest, 32);
    EXPECT_LT(largest, method == "flow" ? 0.05 : 0.004);
  }
}

TEST_F(DeepTakeCommand, ExportedEXRsHoldTheSamplesExactly) {
  const CommandResult exported = run_raystage("export images " + quoted("take") + " -o " +
                                              quoted("images") + " --format exr -q");
  ASSERT_EQ(exported.exit_code, 0) << exported.output;
  const store::Take take(path("take"));
  const store::DeepPicture picture = take.archive(0).picture(0);
  int compared = 0;
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(path("images"))) {
    const bool is_first =
        entry.path().string().find(take.document().cameras[0].id) != std::string::npos;
    if (entry.path().extension() == ".exr" && is_first) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  ASSERT_FALSE(files.empty());
  const images::ExrChannelData light = read(files.front());
  for (std::size_t i = 0; i < picture.samples.size(); ++i) {
    EXPECT_EQ(light.values[i], float_from_half(picture.samples[i]));
    ++compared;
  }
  EXPECT_GT(compared, 0);
}

TEST_F(DeepTakeCommand, ExportsOf8BitsSayThatTheyClip) {
  const std::string clipped = "more than 8 bits were written with 8 bits, clipped at white";
  for (const std::string kind : {"images --format jpeg", "images --format png", "multiview"}) {
    const std::string output = kind == "multiview" ? "all.mkv" : kind.substr(kind.size() - 3);
    const CommandResult exported =
        run_raystage("export " + kind + " " + quoted("take") + " -o " + quoted(output) + " -q");
    EXPECT_EQ(exported.exit_code, 0) << exported.output;
    EXPECT_THAT(exported.output, HasSubstr(clipped)) << kind;
  }
  const CommandResult light = run_raystage("export images --format exr " + quoted("take") + " -o " +
                                           quoted("light") + " -q");
  EXPECT_THAT(light.output, ::testing::Not(HasSubstr(clipped)));
  const CommandResult jpeg = run_raystage("export images --format jpeg " + quoted("jpeg") + " -o " +
                                          quoted("plain") + " -q");
  EXPECT_THAT(jpeg.output, ::testing::Not(HasSubstr(clipped)));
}

TEST_F(DeepTakeCommand, ExportsDecodeAFrameOnce) {
  const store::Take take(path("take"));
  exports::FrameChoiceOptions options;
  options.cameras = {take.document().cameras[0].id};
  const exports::FrameChoice choice = exports::choose_frames(take, options);
  using exports::SourceFrames;
  SourceFrames pictures(take, choice.cameras[0], exports::AbsentFrames::kGap,
                        SourceFrames::DeepFrames::kPictures);
  const auto ready = pictures.next();
  ASSERT_TRUE(ready.has_value());
  ASSERT_NE(ready->deep, nullptr);
  EXPECT_EQ(*ready->deep, take.archive(0).picture(0));
  EXPECT_TRUE(ready->jpeg.empty()) << "no JPEG is made that none needs";
  EXPECT_EQ(take.unpacked_frames().bytes_held(), 0U);
}

/// As docs/formats/archive.md describes it.
TEST_F(DeepTakeCommand, OtherProgramsOpenTheFrames) {
  for (const char* program : {"mkvextract", "mkvinfo", "djxl"}) {
    ASSERT_EQ(std::system((std::string("command -v ") + program + " > /dev/null").c_str()), 0)
        << program << " is not installed (scripts/packages.txt)";
  }
  const store::Take take(path("take"));
  write_file_atomically(path("frames.sh"), R"sh(
cd "$1" && mkvextract "$2" tracks --raw 0:frames > /dev/null || exit 1
n=0; at=0
for size in $(mkvinfo -s "$2" | sed -n 's/.* size \([0-9]*\), .*/\1/p'); do
  tail -c +$((at + 1)) frames | head -c $size > $n.jxl
  djxl $n.jxl $n.pfm 2> /dev/null || exit 1
  at=$((at + size)); n=$((n + 1))
done
)sh");
  const std::string script =
      "sh " + quoted("frames.sh") + " " + quoted("take") + " " + take.document().cameras[0].archive;
  ASSERT_EQ(std::system(script.c_str()), 0) << script;
  const store::DeepPicture picture = take.archive(0).picture(0);
  const std::string pfm = read_file(path("take") / "0.pfm");
  // "PF\n96 72\n-1.0\n" or alike, then rows from the bottom up, 32-bit floats.
  const std::size_t floats = picture.samples.size();
  ASSERT_GT(pfm.size(), floats * sizeof(float));
  EXPECT_TRUE(pfm.starts_with("PF\n96 72\n"));
  const bool is_little_endian = pfm.starts_with("PF\n96 72\n-");
  const char* values = pfm.data() + pfm.size() - floats * sizeof(float);
  for (std::size_t i = 0; i < floats; ++i) {
    float value = 0;
    std::array<char, sizeof value> bytes{};
    std::copy_n(values + i * sizeof value, sizeof value, bytes.begin());
    if (!is_little_endian) std::ranges::reverse(bytes);
    std::memcpy(&value, bytes.data(), sizeof value);
    const std::size_t row = 71 - i / (3 * 96);
    EXPECT_EQ(value, float_from_half(picture.samples[row * 3 * 96 + i % (3 * 96)]));
  }
}

TEST_F(DeepTakeCommand, WhatCannotTreatThemSaysSo) {
  const std::string take = read_file(path("take") / "take.json");
  EXPECT_THAT(take, HasSubstr("raystage/take/2"));
  EXPECT_THAT(read_file(path("jpeg") / "take.json"), HasSubstr("raystage/take/1"));
  // An archive that is of another form than take.json states.
  const store::Take deep(path("take"));
  const std::string archive = deep.document().cameras[0].archive;
  fs::copy_file(path("take") / archive, path("jpeg") / archive,
                fs::copy_options::overwrite_existing);
  const CommandResult info = run_raystage("info " + quoted("jpeg"));
  EXPECT_THAT(info.output, HasSubstr("take.json has no \"pixels\""));
}

TEST_F(DeepTakeCommand, IsNotEncodedAsVideo) {
  const CommandResult packed =
      run_raystage("pack " + quoted("take") + " -o " + quoted("packed") + " --temporal av1");
  EXPECT_EQ(packed.exit_code, 2) << packed.output;
  EXPECT_THAT(packed.output, HasSubstr("clipped at white"));
  EXPECT_FALSE(fs::exists(path("packed")));
}

}  // namespace
}  // namespace raystage::testing
