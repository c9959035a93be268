// SPDX-License-Identifier: Apache-2.0
#include "exports/export_depths.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/atomic_file.h"
#include "base/error.h"
#include "depths/depth_image.h"
#include "depths/import_depths.h"
#include "render/depth/imported_maps.h"
#include "store/imported_depths.h"
#include "testing/render/test_depth.h"

namespace raystage::exports {
namespace {

namespace fs = std::filesystem;
using render::InverseDepthMap;

class ExportDepths : public testing::DepthTest {
 protected:
  fs::path out(const std::string& name) const { return folder_.path() / name; }
  static DepthExportOptions to(const fs::path& folder) {
    DepthExportOptions options;
    options.output = folder;
    return options;
  }
  depths::DepthImageReader reader_;
};

TEST_F(ExportDepths, EstimatedDepthsAreThoseOfTheRecordedPictures) {
  schemas::Distortion barrel;
  barrel.k1 = -0.2;
  const store::Take take = write(slanted(3, 3, barrel));
  const ExportReport report = export_depths(take, to(out("maps")), {});
  EXPECT_EQ(report.frames(), 9);
  const rig::Rig::Camera& camera = take.rig().cameras[4];
  const std::string id = take.document().cameras[4].id;
  const InverseDepthMap map = reader_.read(out("maps") / id / "000001.exr", {});
  ASSERT_EQ(map.width, camera.model.width());
  std::vector<double> errors;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const auto ray = camera.model.unproject({x + 0.5, y + 0.5});
      if (!ray || map.at(x, y) < 0) continue;
      const double distance = testing::kSlanted.distance(
          camera.pose.position, camera.pose.world_from_camera_rotation * *ray);
      errors.push_back(std::abs(map.at(x, y) * distance * -ray->z() - 1));
    }
  }
  EXPECT_GT(errors.size(), map.values.size() * 9 / 10);
  std::ranges::nth_element(errors, errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2));
  EXPECT_LT(errors[errors.size() / 2], 0.01);  // as a share of the depth
}

TEST_F(ExportDepths, ImportedMapsComeBackFromBothFormats) {
  const store::Take take = write(slanted(1, 2));
  export_depths(take, to(out("maps")), {});
  depths::import_depths(take, out("maps"), {}, {});
  const auto stored = [&] {
    const auto document = store::read_imported_depths(take);
    return render::read_imported_map(take, 0, 0, *document.find(take.document().cameras[0].id, 0));
  };
  const InverseDepthMap first = stored();
  DepthExportOptions options = to(out("png"));
  options.png_range = schemas::DepthRange{2, 9};
  export_depths(take, options, {});
  export_depths(take, to(out("again")), {});
  depths::DepthImportOptions import;
  import.overwrites = true;
  depths::import_depths(take, out("again"), import, {});
  const InverseDepthMap second = stored();
  for (std::size_t i = 0; i < first.values.size(); ++i) {
    ASSERT_NEAR(first.values[i], second.values[i], 1e-6);
  }
  import.encoding.inverse_range = options.png_range;
  depths::import_depths(take, out("png"), import, {});
  const InverseDepthMap third = stored();
  for (std::size_t i = 0; i < first.values.size(); ++i) {
    ASSERT_EQ(first.values[i] < 0, third.values[i] < 0);
    ASSERT_NEAR(first.values[i], third.values[i], 2e-5);  // a code is 6e-6 1/m
  }
}

TEST_F(ExportDepths, NeedsARangeAndANewFolder) {
  const store::Take take = write(slanted(1, 2));
  DepthExportOptions options = to(out("maps"));
  options.png_range = schemas::DepthRange{2, 1};
  EXPECT_THROW(export_depths(take, options, {}), Error);
  EXPECT_FALSE(fs::exists(out("maps")));
  options.png_range.reset();
  options.output = take_folder() / "maps";
  EXPECT_THROW(export_depths(take, options, {}), Error);
}

}  // namespace
}  // namespace raystage::exports
