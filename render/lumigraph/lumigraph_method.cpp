// SPDX-License-Identifier: Apache-2.0
// The method "lumigraph": chooses the surface by the option `proxy` and renders it by the
// unstructured lumigraph (lumigraph.cpp). The surface is the focal plane, a mesh in front of that
// plane (mesh_proxy.cpp) or the depth maps of the method "depth" (depth_surface.cpp). Cost: that of
// lumigraph.cpp. A mesh is read once; proxy depth estimates the depths once per light field frame.
#include "render/lumigraph/lumigraph_method.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "render/common/faceted_frame.h"
#include "render/common/focal_surface.h"
#include "render/depth/depth.h"
#include "render/depth/depth_store.h"
#include "render/depth/depth_surface.h"
#include "render/depth/imported_depths.h"
#include "render/lumigraph/lumigraph.h"
#include "render/lumigraph/mesh_proxy.h"
#include "store/scene_depth_range.h"

namespace raystage::render {
namespace {

std::filesystem::path mesh_file(const MethodOptions& options, const store::Take& take) {
  return take.folder() / options.text("mesh");
}

schemas::DepthRange scene_of(const store::Take& take) {
  return store::scene_depth_range(
      take, {}, "proxy depth",
      "Set depth_range_m in take.json, in metres in front of the array, or measure it with "
      "`raystage plan epi`");
}

void check_proxy(const MethodOptions& options, const store::Take& take) {
  const std::string& proxy = options.text("proxy");
  const bool has_mesh = !options.text("mesh").empty();
  if (proxy != "mesh" && has_mesh) {
    throw Error::bad_input("option mesh is set but the option proxy is '" + proxy + "'",
                           "option mesh",
                           "Set the option proxy to mesh, or remove the option mesh");
  }
  if (proxy == "mesh" && !has_mesh) {
    throw Error::bad_input("option proxy is 'mesh' but the option mesh is empty", "option mesh",
                           "Set mesh to its file, relative to the take's folder");
  }
  if (proxy == "depth") scene_of(take);
}

/// Returns the settings of depth::depths_with_default_options().
DepthEstimationOptions default_depth_options(const store::Take& take) {
  DepthEstimationOptions settings;
  settings.scene = scene_of(take);
  return settings;
}

/// Returns the surface that the options `proxy` and `mesh` choose; adds the cost of estimating
/// depths to `work`. Throws Error (bad input) for a mesh that is missing, unreadable or set without
/// the proxy mesh. Also throws for depths of a take without a depth range.
RaySurface proxy_surface(const SurfaceRequest& r, DepthEstimationStatistics& work) {
  RaySurface on_plane = focal_surface(*r.instant.rig, r.focal_plane);
  const store::Take& take = *r.instant.take;
  check_proxy(r.options, take);
  const std::string& proxy = r.options.text("proxy");
  if (proxy == "plane") return on_plane;
  if (proxy == "depth") {
    const schemas::DepthRange scene = scene_of(take);
    const auto facets = std::make_shared<const FacetedFrame>(r.instant);
    const LightFieldFrame& instant = facets->frame();
    return kept_with(facets, depth_surface(depth::depths_with_default_options(
                                               instant, r.result_cache, r.working_bytes,
                                               r.use_take_folder, scene, work),
                                           *instant.rig, scene));
  }
  const std::filesystem::path file = mesh_file(r.options, take);
  const auto mesh =
      r.result_cache.get<MeshProxy>("mesh proxy " + file.string(), [&file](std::size_t& bytes) {
        auto made = std::make_shared<const MeshProxy>(file);
        bytes = made->bytes();
        return made;
      });
  return [mesh, on_plane = std::move(on_plane)](std::span<const WorldRay> rays,
                                                std::span<double> inverse_distance) {
    mesh->intersect(rays, inverse_distance, on_plane);
  };
}

RaySurface surface_of(const ViewRequest& r, DepthEstimationStatistics& work) {
  return proxy_surface(
      {r.options, r.instant, r.focal_plane, r.result_cache, r.working_bytes, r.use_take_folder},
      work);
}

WeightField field_of(const ViewRequest& request) {
  return request.options.text("weights") == "blending_field" ? WeightField::kBlendingField
                                                             : WeightField::kPerPixel;
}

std::vector<OptionSpec> lumigraph_options() {
  std::vector<OptionSpec> all = ray_weight_options();
  all.push_back(
      choice_option("proxy", "plane", "plane|mesh|depth",
                    "surface on which rays are looked up: the focal plane; a mesh with the "
                    "plane behind it; or the depths of method depth"));
  all.push_back(text_option("mesh", "",
                            "file of the mesh (OBJ, PLY, glTF ...; world, metres), relative to "
                            "the take's folder"));
  all.push_back(choice_option("weights", "per_pixel", "per_pixel|blending_field",
                              "computed per pixel, or every 16 pixels and interpolated"));
  return all;
}

class LumigraphMethod final : public Method {
 public:
  std::string_view name() const override { return "lumigraph"; }
  MethodDescription description() const override {
    return {.summary = "blends the best few cameras of each ray where it meets a geometry proxy",
            .artefacts = "doubled edges where the proxy is wrong",
            .use = "sets that were scanned or modelled"};
  }
  bool blends_any_camera() const override { return true; }
  std::span<const OptionSpec> options() const override { return options_; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{{"fast", "weights=blending_field"},
                                             {"8 cameras", "cameras=8"},
                                             {"on depth", "proxy=depth"}};
    return kPresets;
  }

  RenderedView render(const ViewRequest& request) const override {
    DepthEstimationStatistics work;
    const RaySurface surface = surface_of(request, work);
    RenderedView image =
        render_lumigraph(request, surface, ray_weight_options(request.options), field_of(request));
    image.statistics.working_bytes = std::max(image.statistics.working_bytes, work.bytes);
    image.statistics.pixels_decoded += work.pixels_decoded;
    return image;
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    DepthEstimationStatistics work;
    return render_lumigraph_reference(request, surface_of(request, work),
                                      ray_weight_options(request.options));
  }

  /// Returns kNone for proxy depth: every host would need the depths of cameras that it does not
  /// hold.
  DistributionMode distribution(const MethodOptions& options) const override {
    return options.text("proxy") == "depth" ? DistributionMode::kNone
                                            : DistributionMode::kContributions;
  }
  Contribution contribute(const ViewRequest& request) const override {
    DepthEstimationStatistics none;
    return contribute_lumigraph(request, surface_of(request, none),
                                ray_weight_options(request.options), field_of(request));
  }
  RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const override {
    DepthEstimationStatistics none;
    return combine_lumigraph(request, surface_of(request, none),
                             ray_weight_options(request.options), field_of(request),
                             std::move(planes.at(0)));
  }

  void check(const MethodOptions& options, const store::Take& take) const override {
    check_proxy(options, take);
  }
  std::vector<std::filesystem::path> input_files(const MethodOptions& options,
                                                 const store::Take& take,
                                                 const store::FrameSelection&) const override {
    if (options.text("proxy") != "mesh") return {};
    return {mesh_file(options, take)};
  }

  bool stores_data() const override { return true; }
  std::filesystem::path stored_file(const MethodOptions& options,
                                    const LightFieldFrame& instant) const override {
    if (options.text("proxy") != "depth") return {};
    const FacetedFrame facets(instant);
    if (ImportedDepths(*instant.take).covers(facets.frame(), {})) return {};
    return depth_file_path(instant.derived_folder(),
                           depth_store_key(facets.frame(), default_depth_options(*instant.take)));
  }
  StoreResult store(const MethodOptions& /*options*/, const LightFieldFrame& instant,
                    std::size_t working_bytes) const override {
    return store_camera_depths(FacetedFrame(instant).frame(), default_depth_options(*instant.take),
                               working_bytes);
  }

  RaySurface surface(const SurfaceRequest& r) const override {
    DepthEstimationStatistics work;
    return proxy_surface(r, work);
  }
  bool has_ray_weights() const override { return true; }

  /// Returns false for proxy depth: depths that do not fit in memory would be estimated for every
  /// few rows.
  bool is_row_independent(const MethodOptions& options) const override {
    return options.text("proxy") != "depth";
  }

 private:
  std::vector<OptionSpec> options_ = lumigraph_options();
};

}  // namespace

const Method& lumigraph_method() {
  static const LumigraphMethod method;
  return method;
}

}  // namespace raystage::render
