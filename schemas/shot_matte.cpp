// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_matte.h"

#include <fmt/format.h>

#include <array>
#include <initializer_list>

namespace raystage {
namespace {

using nlohmann::ordered_json;
using Box = MatteSettings::Box;
using Kind = MatteSettings::Kind;

constexpr std::array kKindNames{"blue_screen", "green_screen", "difference", "files"};

std::vector<Box> boxes_from(const JsonNode& object, const char* name) {
  std::vector<Box> boxes;
  if (!object.has(name)) return boxes;
  const JsonNode list = object.at(name);
  for (std::size_t i = 0; i < list.size(); ++i) {
    boxes.push_back(list.at(i).get<Box>());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (boxes.back()[0][axis] < boxes.back()[1][axis]) continue;
      throw list.at(i).input_error("found a box without an inside",
                                   "Give the corner with the smallest x, y and z first");
    }
  }
  return boxes;
}

void refuse_words(const JsonNode& object, std::initializer_list<const char*> words,
                  const char* whose) {
  for (const char* word : words) {
    if (!object.has(word)) continue;
    throw object.at(word).input_error(fmt::format("only {} has this property", whose),
                                      "Remove it, or choose another \"kind\"");
  }
}

void check_order(const JsonNode& object, const char* upper_name, double lower, double upper) {
  if (lower < upper) return;
  throw object.input_error(fmt::format("\"{}\" is {}, allowed: above {}", upper_name, upper, lower),
                           "Correct the values, or remove both for the defaults");
}

}  // namespace

MatteSettings matte_settings_from(const JsonNode& object) {
  MatteSettings matte;
  const auto kind = object.at("kind").get<std::string>();
  for (std::size_t i = 0; i < kKindNames.size(); ++i) {
    if (kind == kKindNames[i]) matte.kind = static_cast<Kind>(i);
  }
  const bool is_screen = matte.kind == Kind::kBlueScreen || matte.kind == Kind::kGreenScreen;
  if (!is_screen) {
    refuse_words(object, {"screen_color", "balance", "despill", "black", "white"},
                 "the matte of a blue or green screen");
  }
  if (matte.kind != Kind::kDifference) refuse_words(object, {"low", "high"}, "a difference matte");
  if (matte.kind == Kind::kFiles) {
    refuse_words(object, {"clean_plate_take"}, "a matte that is made from pictures");
  }
  if (matte.kind == Kind::kDifference && !object.has("clean_plate_take")) {
    throw object.input_error("a difference matte needs \"clean_plate_take\"",
                             "Name a take of the same array without the subject");
  }
  matte.screen_color = object.get_if<std::array<double, 3>>("screen_color");
  if (object.has("clean_plate_take"))
    matte.clean_plate_take = path_from(object.at("clean_plate_take"));
  if (matte.screen_color && !matte.clean_plate_take.empty()) {
    throw object.input_error("found both \"screen_color\" and \"clean_plate_take\"",
                             "Remove one of them");
  }
  if (matte.screen_color) {
    const auto& c = *matte.screen_color;
    const std::size_t primary = matte.kind == Kind::kGreenScreen ? 1 : 2;
    if (c[primary] <= c[0] || c[primary] <= c[3 - primary]) {
      throw object.at("screen_color")
          .input_error(fmt::format("the screen is not {}", primary == 1 ? "green" : "blue"),
                       "Give its colour as R, G, B of linear light, or choose another \"kind\"");
    }
  }
  matte.balance = object.get("balance", matte.balance);
  matte.despill = object.get("despill", matte.despill);
  matte.black = object.get("black", matte.black);
  matte.white = object.get("white", matte.white);
  matte.low = object.get("low", matte.low);
  matte.high = object.get("high", matte.high);
  check_order(object, "white", matte.black, matte.white);
  check_order(object, "high", matte.low, matte.high);
  matte.keep = boxes_from(object, "keep");
  matte.garbage = boxes_from(object, "garbage");
  return matte;
}

ordered_json json_from(const MatteSettings& matte) {
  ordered_json object{{"kind", kKindNames[static_cast<std::size_t>(matte.kind)]}};
  if (!matte.clean_plate_take.empty()) object["clean_plate_take"] = matte.clean_plate_take;
  if (matte.kind == Kind::kBlueScreen || matte.kind == Kind::kGreenScreen) {
    add_optional(object, "screen_color", matte.screen_color);
    object["balance"] = matte.balance;
    object["despill"] = matte.despill;
    object["black"] = matte.black;
    object["white"] = matte.white;
  } else if (matte.kind == Kind::kDifference) {
    object["low"] = matte.low;
    object["high"] = matte.high;
  }
  if (!matte.keep.empty()) object["keep"] = matte.keep;
  if (!matte.garbage.empty()) object["garbage"] = matte.garbage;
  return object;
}

}  // namespace raystage
