// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/error.h"
#include "render/common/plane_projection.h"
#include "render/slabs/slabs.h"

namespace raystage {
namespace {

const OptionSpec kOptions[] = {
    choice_option("interpolation", "quadrilinear", "quadrilinear|bilinear_st|nearest",
                  "samples per ray: 4 nodes x 4 pixels, 4 x 1, or 1 x 1"),
    choice_option(
        "layout", "single", "single|box",
        "one slab of all cameras, or up to six around a rig that looks outwards: each ray "
        "uses the face of the box through which it leaves"),
    integer_option("columns", 0, 0, 1024,
                   "nodes (s) along each camera plane; 0: as many as the rig's grid has, or by the "
                   "density of its cameras"),
    integer_option("rows", 0, 0, 1024, "nodes (t) across each camera plane; 0: as for columns"),
    number_option("uv_scale", 1, 0.05, 4,
                  "samples of the image plane (u,v) per finest source pixel, along each axis; the "
                  "memory of a slab grows with its square"),
    number_option("max_fov", 150, 10, 170, "largest full angle of an image plane, degrees"),
};

RigSlabs make_slabs(const LightFieldFrame& instant, const SlabSettings& settings) {
  const Rig& rig = *instant.rig;
  const std::vector<int>& complete = instant.included_cameras;
  RigSlabs made;
  made.slabs = fit_slabs(rig, complete, instant.complete->normal, settings);
  for (const Slab& slab : made.slabs) {
    if (slab.cameras == complete) {
      made.nodes.push_back(node_sources(slab, rig, *instant.present, *instant.complete));
      continue;
    }
    const Topology all = make_topology(rig, slab.cameras);
    std::vector<int> there;
    std::ranges::copy_if(slab.cameras, std::back_inserter(there),
                         [&](int camera) { return instant.is_present(camera); });
    std::optional<Topology> some;
    if (there != slab.cameras) some = there.empty() ? Topology{} : make_topology(rig, there);
    made.nodes.push_back(node_sources(slab, rig, some ? *some : all, all));
  }
  return made;
}

}  // namespace

Eigen::Vector4d slab_focal_plane(const Slab& slab, const ViewRequest& request) {
  const Eigen::Vector4d& plane = request.focal_plane;
  const double normal = plane.head<3>().norm();
  if (slab.competing_axes.empty() || normal == 0) return plane;
  const Eigen::Vector3d middle = request.instant.rig->centre();
  const double distance = std::abs(signed_plane_distance(plane, middle));
  const Eigen::Vector3d ahead = slab.pose.viewing_direction();
  return {ahead.x(), ahead.y(), ahead.z(), -(ahead.dot(middle) + distance)};
}

SlabInterpolation slab_interpolation(const MethodOptions& options) {
  const std::string& name = options.text("interpolation");
  if (name == "nearest") return SlabInterpolation::kNearest;
  return name == "bilinear_st" ? SlabInterpolation::kBilinearNodes
                               : SlabInterpolation::kQuadrilinear;
}

std::shared_ptr<const RigSlabs> rig_slabs(const ViewRequest& request) {
  const MethodOptions& options = request.options;
  SlabSettings settings;
  settings.layout =
      options.text("layout") == "box" ? SlabSettings::Layout::kBox : SlabSettings::Layout::kSingle;
  settings.columns = options.integer("columns");
  settings.rows = options.integer("rows");
  settings.uv_scale = options.number("uv_scale");
  settings.max_fov = options.number("max_fov") * std::numbers::pi / 180;
  std::string present;
  for (const int camera : request.instant.included_cameras) {
    present += request.instant.is_present(camera) ? '1' : '0';
  }
  const std::string key =
      fmt::format("slabs of the rig\n{} {} {} {:a} {:a}\n{}\n{}", options.text("layout"),
                  settings.columns, settings.rows, settings.uv_scale, settings.max_fov,
                  fmt::join(request.instant.included_cameras, " "), present);
  return request.result_cache.get<RigSlabs>(key, [&](std::size_t& bytes) {
    auto made = std::make_shared<const RigSlabs>(make_slabs(request.instant, settings));
    for (const auto& nodes : made->nodes) bytes += nodes.size() * sizeof(NodeSources);
    return made;
  });
}

namespace {

class SlabsMethod final : public Method {
 public:
  std::string_view name() const override { return "slabs"; }
  std::string_view summary() const override {
    return "four cameras per ray, from two-plane light fields (slabs) of rectified frames";
  }
  std::span<const OptionSpec> options() const override { return kOptions; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{{"fast", "interpolation=bilinear_st"},
                                             {"small", "uv_scale=0.5"}};
    return kPresets;
  }
  RenderedView render(const ViewRequest& request) const override { return render_slabs(request); }
  RenderedView render_reference(const ViewRequest& request) const override {
    return render_slabs_reference(request);
  }
  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kContributions;
  }
  Contribution contribute(const ViewRequest& request) const override {
    return contribute_slabs(request);
  }
  RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const override {
    return combine_slabs(request, planes.at(0));
  }
  void check_ray_support(const MethodOptions& options) const override {
    if (options.text("layout") != "box") return;
    throw Error::bad_input(
        "slabs with layout box sample rays on a plane per face, but single rays need one plane",
        "method slabs", "Render views, or choose another method for rays");
  }
  /// Also where memory is too short to cache node images: bands then make shared images again, and
  /// pixels do not depend on the budget.
  bool is_row_independent(const MethodOptions&) const override { return true; }
};

}  // namespace

const Method& slabs_method() {
  static const SlabsMethod method;
  return method;
}

}  // namespace raystage
