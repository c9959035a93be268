// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <initializer_list>

#include "schemas/fields.h"
#include "schemas/shot.h"

namespace raystage::schemas {
namespace {

using Kind = MatteSettings::Kind;

constexpr auto kKindNames = enum_names<Kind>("blue_screen", "green_screen", "difference", "files");

bool is_screen(const MatteSettings& matte) {
  return matte.kind == Kind::kBlueScreen || matte.kind == Kind::kGreenScreen;
}

bool is_difference(const MatteSettings& matte) { return matte.kind == Kind::kDifference; }

void reject_foreign_keys(const JsonNode& object, std::initializer_list<const char*> keys,
                         const char* owner) {
  reject_keys(object, keys, fmt::format("only {} has this property", owner),
              "Remove it, or choose another \"kind\"");
}

void check_order(const JsonNode& object, const char* upper_name, double lower, double upper) {
  if (lower < upper) return;
  throw object.input_error(fmt::format("\"{}\" is {}, allowed: above {}", upper_name, upper, lower),
                           "Correct the values, or remove both for the defaults");
}

void check_kind_of_matte(const JsonNode& object, const MatteSettings& matte) {
  if (!is_screen(matte)) {
    reject_foreign_keys(object, {"screen_color", "balance", "despill", "black", "white"},
                        "the matte of a blue or green screen");
  }
  if (!is_difference(matte)) reject_foreign_keys(object, {"low", "high"}, "a difference matte");
  if (matte.kind == Kind::kFiles) {
    reject_foreign_keys(object, {"clean_plate_take"}, "a screen or difference matte");
  }
  if (is_difference(matte) && !object.has("clean_plate_take")) {
    throw object.input_error("a difference matte needs \"clean_plate_take\"",
                             "Name a take of the same array without the subject");
  }
}

void check_screen_color(const JsonNode& object, const MatteSettings& matte) {
  if (!matte.screen_color) return;
  if (!matte.clean_plate_take.empty()) {
    throw object.input_error("found both \"screen_color\" and \"clean_plate_take\"",
                             "Remove one of them");
  }
  const auto& c = *matte.screen_color;
  const std::size_t primary = matte.kind == Kind::kGreenScreen ? 1 : 2;
  if (c[primary] <= c[0] || c[primary] <= c[3 - primary]) {
    throw object.at("screen_color")
        .input_error(fmt::format("the screen is not {}", primary == 1 ? "green" : "blue"),
                     "Give its colour as R, G, B of linear light, or choose another \"kind\"");
  }
}

void check_levels(const JsonNode& object, const MatteSettings& matte) {
  check_order(object, "white", matte.black, matte.white);
  check_order(object, "high", matte.low, matte.high);
}

constexpr auto kBoxes =
    list_of(PlainCodec{}, [](const JsonNode& node, const std::vector<MatteSettings::Box>& boxes) {
      check_box(node, boxes.back());
    });

constexpr Fields kMatte(
    required("kind", &MatteSettings::kind, kKindNames), check(check_kind_of_matte),
    optional("clean_plate_take", &MatteSettings::clean_plate_take, kPath),
    written_if(is_screen, optional("screen_color", &MatteSettings::screen_color),
               check(check_screen_color), defaulted("balance", &MatteSettings::balance),
               defaulted("despill", &MatteSettings::despill),
               defaulted("black", &MatteSettings::black),
               defaulted("white", &MatteSettings::white)),
    written_if(is_difference, defaulted("low", &MatteSettings::low),
               defaulted("high", &MatteSettings::high)),
    check(check_levels), optional("keep", &MatteSettings::keep, kBoxes),
    optional("garbage", &MatteSettings::garbage, kBoxes));

}  // namespace

MatteSettings matte_settings_from(const JsonNode& object) {
  return kMatte.make<MatteSettings>(object);
}

nlohmann::ordered_json json_from(const MatteSettings& matte) { return kMatte.write(matte); }

}  // namespace raystage::schemas
