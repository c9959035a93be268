// SPDX-License-Identifier: Apache-2.0
#include "compose/color/built_in_config.h"

namespace raystage::compose {
namespace {

namespace OCIO = OCIO_NAMESPACE;

OCIO::BuiltinTransformRcPtr builtin(const char* style) {
  OCIO::BuiltinTransformRcPtr transform = OCIO::BuiltinTransform::Create();
  transform->setStyle(style);
  return transform;
}

OCIO::GroupTransformRcPtr ap0_from_rec709() {
  OCIO::BuiltinTransformRcPtr ap1_from_rec709 = builtin("UTILITY - ACES-AP1_to_LINEAR-REC709_BFD");
  ap1_from_rec709->setDirection(OCIO::TRANSFORM_DIR_INVERSE);
  OCIO::GroupTransformRcPtr group = OCIO::GroupTransform::Create();
  group->appendTransform(ap1_from_rec709);
  group->appendTransform(builtin("ACEScg_to_ACES2065-1"));
  return group;
}

OCIO::TransformRcPtr linear_from_srgb_code() {
  OCIO::ExponentWithLinearTransformRcPtr curve = OCIO::ExponentWithLinearTransform::Create();
  constexpr double kGamma[4] = {2.4, 2.4, 2.4, 1}, kOffset[4] = {0.055, 0.055, 0.055, 0};
  curve->setGamma(kGamma);
  curve->setOffset(kOffset);
  return curve;
}

void add_scene_space(OCIO::Config& config, const char* name, const char* alias,
                     const OCIO::ConstTransformRcPtr& ap0_from_space) {
  OCIO::ColorSpaceRcPtr space = OCIO::ColorSpace::Create(OCIO::REFERENCE_SPACE_SCENE);
  space->setName(name);
  if (alias != nullptr) space->addAlias(alias);
  space->setBitDepth(OCIO::BIT_DEPTH_F32);
  if (ap0_from_space) space->setTransform(ap0_from_space, OCIO::COLORSPACE_DIR_TO_REFERENCE);
  config.addColorSpace(space);
}

constexpr const char* kPlain = "Plain";
constexpr const char* kAces = "ACES 1.0 SDR";

void add_display(OCIO::Config& config, const char* name, const char* from_xyz) {
  OCIO::ColorSpaceRcPtr space = OCIO::ColorSpace::Create(OCIO::REFERENCE_SPACE_DISPLAY);
  space->setName(name);
  space->setTransform(builtin(from_xyz), OCIO::COLORSPACE_DIR_FROM_REFERENCE);
  config.addColorSpace(space);
  for (const char* view : {kPlain, kAces}) {
    config.addDisplayView(name, view, view, name, "", "", "");
  }
}

void add_view_transform(OCIO::Config& config, const char* name, const char* xyz_from_ap0) {
  OCIO::ViewTransformRcPtr view = OCIO::ViewTransform::Create(OCIO::REFERENCE_SPACE_SCENE);
  view->setName(name);
  view->setTransform(builtin(xyz_from_ap0), OCIO::VIEWTRANSFORM_DIR_FROM_REFERENCE);
  config.addViewTransform(view);
}

}  // namespace

OCIO::ConstConfigRcPtr built_in_color_config() {
  OCIO::ConfigRcPtr config = OCIO::Config::Create();
  config->setVersion(2, 1);
  config->setName("raystage-1");
  add_scene_space(*config, "lin_ap0_scene", "ACES2065-1", nullptr);
  add_scene_space(*config, "lin_ap1_scene", "ACEScg", builtin("ACEScg_to_ACES2065-1"));
  add_scene_space(*config, "lin_rec709_scene", "lin_rec709", ap0_from_rec709());
  OCIO::GroupTransformRcPtr from_code = OCIO::GroupTransform::Create();
  from_code->appendTransform(linear_from_srgb_code());
  from_code->appendTransform(ap0_from_rec709());
  add_scene_space(*config, "srgb_texture", nullptr, from_code);
  OCIO::ColorSpaceRcPtr data = OCIO::ColorSpace::Create();
  data->setName("data");
  data->setIsData(true);
  config->addColorSpace(data);
  add_view_transform(*config, kPlain, "UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD");
  add_view_transform(*config, kAces, "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-VIDEO_1.0");
  add_display(*config, "sRGB", "DISPLAY - CIE-XYZ-D65_to_sRGB");
  add_display(*config, "Rec.1886", "DISPLAY - CIE-XYZ-D65_to_REC.1886-REC.709");
  add_display(*config, "P3-D65", "DISPLAY - CIE-XYZ-D65_to_G2.6-P3-D65");
  config->setRole(OCIO::ROLE_SCENE_LINEAR, "lin_rec709_scene");
  config->setRole(OCIO::ROLE_DEFAULT, "data");
  config->setRole(OCIO::ROLE_INTERCHANGE_SCENE, "lin_ap0_scene");
  config->validate();
  return config;
}

}  // namespace raystage::compose
