// SPDX-License-Identifier: Apache-2.0
#include "depths/import_depths.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "images/image_file.h"
#include "render/depth/depth_file.h"
#include "render/depth/imported_maps.h"
#include "store/imported_depths.h"
#include "testing/depths/import_depths_test_data.h"
#include "testing/render/test_depth.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Document = schemas::ImportedDepthsDocument;
using ImportDepths = testing::ImportDepths;

TEST_F(ImportDepths, TrueDepthsOfASurfaceRenderAtLeastAsWellAsEstimatedOnes) {
  settings_ = slanted(3, 3, barrel());
  settings_.samples = 3;
  distance_ = testing::slanted_distance;
  const store::Take take = write(settings_);
  const render::ReconstructionOptions depth{"depth", {0, 0, 0, 1}, {}};
  const render::ReconstructionOptions lumigraph{
      "lumigraph", {0, 0, 0, 1}, {{"proxy", std::string("depth")}}};
  const double estimated = quality(take, depth), estimated_surface = quality(take, lumigraph);
  const auto before = stored_depth_files();
  for (const bool as_png : {false, true}) {
    fs::remove_all(maps());
    write_maps(take, as_png);
    DepthImportOptions options = as_png ? png_options() : DepthImportOptions{};
    options.overwrites = as_png;
    const DepthImportReport report = import_depths(take, maps(), options, {});
    EXPECT_EQ(report.maps, 9U);
    EXPECT_EQ(report.replaced, as_png ? 9U : 0U);
    EXPECT_TRUE(report.notes.empty());
    EXPECT_EQ(stored_maps(take), 9U);
    EXPECT_GE(quality(take, depth), estimated);
    EXPECT_GE(quality(take, lumigraph), estimated_surface);
  }
  // Neither are depths estimated, nor are those that were stored touched.
  EXPECT_EQ(stored_depth_files(), before);
  EXPECT_THAT(render(take, testing::default_view()).notes,
              Contains(HasSubstr("imported depth maps")));
}

// Depths at pixel centres cut pixels at edges, of which estimation takes the surface that the
// colours agree with.
TEST_F(ImportDepths, TrueDepthsAtEdgesRenderAlmostAsWellAsEstimatedOnes) {
  const store::Take take = write_step(3, 3, barrel());
  const render::ReconstructionOptions depth{"depth", {0, 0, 0, 1}, {}};
  const double estimated = quality(take, depth);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  EXPECT_GT(quality(take, depth), estimated - 1);
}

TEST_F(ImportDepths, AMapComesBackAndUnknownDepthsStayUnknown) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  std::vector<float> z = testing::true_depths(take.rig().cameras[0], 96, 72);
  for (const std::size_t hole : {0U, 100U, 5000U}) z[hole] = std::nanf("");
  const std::string& id = take.document().cameras[0].id;
  images::write_depth_image(96, 72, z, maps() / id / "000001.exr");
  EXPECT_GT(import_depths(take, maps(), {}, {}).unknown_share, 0);
  const Document document = store::read_imported_depths(take);
  const Document::Map* entry = document.find(id, 0);
  ASSERT_NE(entry, nullptr);
  EXPECT_EQ(entry->quantity, Document::Quantity::kInverseDepth);
  EXPECT_EQ(entry->source, id + "/000001.exr");
  EXPECT_NEAR(entry->unknown_share, 3 / (96.0 * 72), 1e-9);
  EXPECT_EQ(document.imports.at(0).encoding, "EXR, channel Z, planar depth, 1 m a unit");
  const render::InverseDepthMap map = render::read_imported_map(take, 0, 0, *entry);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (std::isnan(z[i])) {
      EXPECT_EQ(map.values[i], render::kUnknownDepth);
    } else {
      ASSERT_NEAR(map.values[i], 1 / z[i], 1e-5);
    }
  }
  EXPECT_EQ(document.find(id, 1), nullptr);
  EXPECT_EQ(document.find("other", 0), nullptr);
}

TEST_F(ImportDepths, MapsOfOtherSizesAreNotBlendedAcrossEdges) {
  const store::Take take = write_step(3, 3, barrel());
  const double estimated = quality(take, {"depth", {0, 0, 0, 1}, {}});
  write_maps(take, false, 2);
  EXPECT_EQ(import_depths(take, maps(), {}, {}).maps, 9U);
  EXPECT_GT(quality(take, {"depth", {0, 0, 0, 1}, {}}), estimated - 1.5);
  const rig::CameraModel& model = take.rig().cameras[0].model;
  const render::VirtualCamera pinhole = render::undistorted(model, take.rig().cameras[0].pose);
  render::InverseDepthMap step(48, 36);
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 48; ++x) step.at(x, y) = x < 24 ? 0.4F : 0.2F;
  }
  const render::InverseDepthMap whole =
      render::undistorted_depths(step, render::DepthQuantity::kPlanar, model, pinhole, 0.1F);
  std::set<float> found(whole.values.begin(), whole.values.end());
  found.erase(render::kUnknownDepth);
  EXPECT_EQ(found, (std::set<float>{0.2F, 0.4F}));
}

TEST_F(ImportDepths, NamesWhatIsWrong) {
  const store::Take take = write_step(1, 2);
  const std::string id = take.document().cameras[0].id;
  create_folder(maps());
  EXPECT_THAT(refusal(take), HasSubstr("no depth maps of the take's frames"));
  write_maps(take);
  fs::rename(maps() / id, maps() / "cam7");
  EXPECT_THAT(refusal(take), AllOf(HasSubstr("no camera \"cam7\""), HasSubstr(id)));
  fs::rename(maps() / "cam7", maps() / id);
  fs::copy_file(maps() / id / "000001.exr", maps() / id / "000002.exr");
  EXPECT_THAT(refusal(take), HasSubstr("there is no frame 2"));
  fs::rename(maps() / id / "000002.exr", maps() / id / "1.exr");
  EXPECT_THAT(refusal(take), HasSubstr("are of the same frame"));
  fs::rename(maps() / id / "1.exr", maps() / id / "first.exr");
  EXPECT_THAT(refusal(take), HasSubstr("is no number from 1"));
  fs::remove(maps() / id / "first.exr");
  images::write_depth_image(96, 96, std::vector<float>(96UL * 96, 2), maps() / id / "000001.exr");
  EXPECT_THAT(refusal(take), AllOf(HasSubstr("96x96"), HasSubstr("the shapes differ")));
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{8, 6}, std::pair{95, 1}}) {
    const std::vector<float> z(static_cast<std::size_t>(width * height), 2);
    images::write_depth_image(width, height, z, maps() / id / "000001.exr");
    EXPECT_THAT(refusal(take), HasSubstr("allowed: at least 8 and a 16th"));
  }
  EXPECT_EQ(stored_maps(take), 0U);
  fs::remove_all(maps());
  fs::create_directory_symlink("/etc", (create_folder(maps()), maps() / id));
  EXPECT_THAT(refusal(take), HasSubstr("no depth maps"));
}

TEST_F(ImportDepths, ImplausibleUnitsAreNoted) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  DepthImportOptions options;
  options.encoding.unit_m = 0.001;
  EXPECT_THAT(import_depths(take, maps(), options, {}).notes,
              Contains(HasSubstr("far outside of the take's depth range")));
}

// A depth of 1 mm needs steps in which 10 m become 10.7 m.
TEST_F(ImportDepths, APixelThatIsMuchTooNearLeavesTheOthersPrecise) {
  const store::Take take = write_step(1, 2);
  const std::vector<std::string> ids{take.document().cameras[0].id, take.document().cameras[1].id};
  for (const std::string& id : ids) create_folder(maps() / id);
  std::vector<float> z(96UL * 72, 10);
  std::ranges::fill_n(z.begin(), 100, 5.0F);
  z[7] = 200;
  z[8] = 0.1F;  // a near object, which is kept
  images::write_depth_image(96, 72, z, maps() / ids[1] / "000001.exr");
  z[5000] = z[5001] = 0.001F;
  images::write_depth_image(96, 72, z, maps() / ids[0] / "000001.exr");
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.too_near, 2U);
  EXPECT_NEAR(report.unknown_share, 1 / (96.0 * 72), 1e-9);
  EXPECT_THAT(report.notes, ElementsAre(AllOf(HasSubstr("2 pixels of 1 of 2 maps are so near"),
                                              HasSubstr(": " + ids[0] + "/000001.exr"))));
  const Document document = store::read_imported_depths(take);
  const auto map_of = [&](int camera) {
    return render::read_imported_map(take, camera, 0,
                                     *document.find(ids[static_cast<std::size_t>(camera)], 0));
  };
  render::InverseDepthMap spoiled = map_of(0);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (i == 5000 || i == 5001) {
      EXPECT_EQ(spoiled.values[i], render::kUnknownDepth);
    } else {
      ASSERT_NEAR(spoiled.values[i], 1 / z[i], 1.25e-4) << i;  // half a step
    }
  }
  // The map without outliers has the step and the bytes that it always had.
  const render::InverseDepthMap plain = map_of(1);
  EXPECT_EQ(render::depth_step(plain), std::ldexp(1.0F, -12));
  spoiled.values[5000] = spoiled.values[5001] = plain.values[5000];
  EXPECT_EQ(spoiled.values, plain.values);
}

TEST_F(ImportDepths, CoarseStepsAreNoted) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  std::vector<float> z(96UL * 72, 5);
  std::ranges::fill_n(z.begin(), 200, 1e-4F);  // 3 %
  const std::string file = take.document().cameras[1].id + "/000001.exr";
  images::write_depth_image(96, 72, z, maps() / file);
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.too_near, 0U);
  EXPECT_EQ(report.unknown_share, 0);
  EXPECT_THAT(report.notes, ElementsAre(AllOf(HasSubstr("of 1 of 2 maps are rounded by up to 1 "),
                                              HasSubstr(": " + file))));
}

TEST_F(ImportDepths, EveryInstantOfAMovingTakeHasItsOwnMaps) {
  settings_ = slanted(2, 3);
  settings_.frames = 3;
  settings_.absent = {{1, 2}};  // camera 1 has no frame at the third tick
  const store::Take take = write(settings_);
  store::write_timeline(store::build_timeline(take, 15, 0), take);
  const std::vector<double> metres{3, 4, 5};
  for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
    const fs::path folder = maps() / take.document().cameras[i].id;
    create_folder(folder);
    for (std::size_t tick = 0; tick < metres.size(); ++tick) {
      images::write_depth_image(96, 72,
                                std::vector<float>(96UL * 72, static_cast<float>(metres[tick])),
                                folder / ("00000" + std::to_string(tick + 1) + ".exr"));
    }
  }
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.maps, 17U);
  EXPECT_THAT(report.notes, Contains(HasSubstr("no frame at their time: ")));
  for (const char* const method : {"depth", "lumigraph"}) {
    render::ReconstructionOptions how{method, {0, 0, 0, 1}, {}};
    if (std::string_view(method) == "lumigraph") how.options = {{"proxy", std::string("depth")}};
    for (std::size_t tick = 0; tick < metres.size(); ++tick) {
      const render::RenderedView view =
          render_reconstruction(take, testing::default_view(), how, {}, static_cast<int>(tick));
      std::vector<float> z(view.z.begin(), view.z.end());
      std::ranges::nth_element(z, z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2));
      EXPECT_NEAR(z[z.size() / 2], metres[tick] + 0.03, 0.1) << method << " " << tick;
    }
  }
  EXPECT_TRUE(stored_depth_files().empty());
}

// The pictures and the maps of the frames before and after are those of the same surface, so that
// estimated depths would be averaged.
TEST_F(ImportDepths, MapsAreNotAveragedOverTime) {
  settings_ = slanted(2, 3);
  settings_.frames = 3;  // all equal
  distance_ = testing::slanted_distance;
  const store::Take take = write(settings_);
  write_maps(take);
  for (const auto& camera : fs::directory_iterator(maps())) {
    fs::rename(camera.path() / "000001.exr", camera.path() / "000002.exr");
  }
  DepthImportOptions options;
  options.numbers = MapNumbers::kRecorded;
  import_depths(take, maps(), options, {});
  for (const auto& camera : fs::directory_iterator(maps())) {
    fs::copy(camera.path() / "000002.exr", camera.path() / "000001.exr");
    fs::rename(camera.path() / "000002.exr", camera.path() / "000003.exr");
  }
  options.encoding.unit_m = 1.01;
  import_depths(take, maps(), options, {});
  const store::Timeline timeline = store::build_timeline(take, 15, 0);
  render::RendererOptions on_ticks;
  on_ticks.ticks = timeline.ticks;
  const auto depths = [&](bool temporal) {
    return render(take, testing::default_view(), {{"temporal", temporal}}, on_ticks, 1).z;
  };
  EXPECT_EQ(depths(true), depths(false));
}

TEST(RecordedDepths, GoToTheCameraWithoutDistortionAndBack) {
  for (const bool is_fisheye : {false, true}) {
    schemas::CameraGeometry geometry{"a", 128, 96, {}, {}, {}, {}};
    geometry.intrinsics = {60, 60, 64, 48, {-0.2, 0.05, 0, 0, 0}};
    if (is_fisheye) {
      geometry.intrinsics.distortion = {};
      geometry.intrinsics.projection = schemas::Projection::kFisheye;
    }
    const rig::CameraModel model(geometry);
    const render::DepthQuantity quantity = render::stored_quantity(model);
    EXPECT_EQ(quantity,
              is_fisheye ? render::DepthQuantity::kDistance : render::DepthQuantity::kPlanar);
    // A fronto-parallel plane at 2 m. The outer half of border pixels has the value of their
    // centres: beside a fisheye's axis, distances change by 1 % there.
    render::InverseDepthMap map(128, 96, 0.5F);
    render::convert_recorded_depths(map, model, render::DepthQuantity::kPlanar, quantity);
    const render::VirtualCamera pinhole = render::undistorted(model, {});
    const render::InverseDepthMap whole =
        render::undistorted_depths(map, quantity, model, pinhole, 0.05F);
    const auto known = std::ranges::count_if(whole.values, [](float value) { return value >= 0; });
    EXPECT_GT(known, static_cast<std::ptrdiff_t>(whole.values.size() / 3));
    for (const float value : whole.values) {
      if (value < 0) continue;
      ASSERT_NEAR(value, 0.5, is_fisheye ? 1e-2 : 2e-3);
    }
    render::InverseDepthMap back(128, 96, render::kUnknownDepth);
    render::add_recorded_depths(whole, pinhole, model, quantity, 0.05F, back);
    for (int y = 8; y < 88; ++y) {
      for (int x = 8; x < 120; ++x)
        ASSERT_NEAR(back.at(x, y), map.at(x, y), is_fisheye ? 1e-2 : 2e-3);
    }
  }
}

}  // namespace
}  // namespace raystage::depths
