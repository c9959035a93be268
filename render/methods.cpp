// SPDX-License-Identifier: Apache-2.0
#include "render/methods.h"

#include <algorithm>
#include <array>
#include <string>

#include "render/focal_plane.h"
#include "schemas/error.h"

namespace raystage {
namespace {

template <CornerWeights kWeights>
RenderedView on_plane(const ViewRequest& r) {
  return render_focal_plane(r.view, r.instant, r.focal_plane, kWeights, r.count_needed_pixels);
}

template <CornerWeights kWeights>
RenderedView on_plane_reference(const ViewRequest& r) {
  return render_focal_plane_reference(r.view, r.instant, r.focal_plane, kWeights,
                                      r.count_needed_pixels);
}

constexpr std::array kMethods{
    Method{"focal_plane", "three cameras a ray, blended where it meets the focal plane",
           on_plane<CornerWeights::kLinear>, on_plane_reference<CornerWeights::kLinear>},
    Method{"nearest", "the camera nearest to the ray, alone, where it meets the focal plane",
           on_plane<CornerWeights::kNearest>, on_plane_reference<CornerWeights::kNearest>}};

}  // namespace

std::span<const Method> methods() { return kMethods; }

const Method& method_named(std::string_view name) {
  const auto found = std::ranges::find(kMethods, name, &Method::name);
  if (found != kMethods.end()) return *found;
  std::string names;
  for (const Method& method : kMethods) {
    names += (names.empty() ? "" : ", ") + std::string(method.name);
  }
  throw Error::bad_input("there is no reconstruction method '" + std::string(name) + "'", "method",
                         "Methods: " + names);
}

}  // namespace raystage
