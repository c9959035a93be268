// SPDX-License-Identifier: Apache-2.0
#include "replay/server/access_control.h"

#include <gtest/gtest.h>

#include <set>

namespace raystage::replay {
namespace {

const AccessRules kRules{"0123456789abcdef0123456789abcdef", {"127.0.0.1:8080", "localhost:8080"}};
const std::string kTarget = "/0123456789abcdef0123456789abcdef/index.html";

TEST(AccessControl, GrantsItsOwnPages) {
  EXPECT_EQ(check_access(kRules, {kTarget, "127.0.0.1:8080", {}, false}), AccessDecision::kGranted);
  EXPECT_EQ(check_access(kRules, {kTarget, "LocalHost:8080", "http://localhost:8080", true}),
            AccessDecision::kGranted);
}

TEST(AccessControl, RefusesOtherHosts) {
  for (const char* host : {"evil.example:8080", "127.0.0.1", "127.0.0.1:80801", ""}) {
    EXPECT_EQ(check_access(kRules, {kTarget, host, {}, false}), AccessDecision::kWrongHost) << host;
  }
  EXPECT_EQ(check_access(kRules, {kTarget, {}, {}, false}), AccessDecision::kWrongHost);
}

TEST(AccessControl, RefusesOtherOriginsAndWebSocketsWithout) {
  for (const char* origin : {"http://evil.example", "https://127.0.0.1:8080", "null", "",
                             "http://127.0.0.1:8080.evil.example", "http://127.0.0.1:8080/"}) {
    EXPECT_EQ(check_access(kRules, {kTarget, "127.0.0.1:8080", origin, false}),
              AccessDecision::kWrongOrigin)
        << origin;
  }
  EXPECT_EQ(check_access(kRules, {kTarget, "127.0.0.1:8080", {}, true}),
            AccessDecision::kWrongOrigin);
}

TEST(AccessControl, RefusesOtherTokens) {
  for (const char* target :
       {"/", "", "*", "/index.html", "/0123456789abcdef0123456789abcdee/index.html",
        "/0123456789abcdef0123456789abcdef", "/0123456789abcdef0123456789abcdef0/",
        "//0123456789abcdef0123456789abcdef/", "0123456789abcdef0123456789abcdef/"}) {
    EXPECT_EQ(check_access(kRules, {target, "127.0.0.1:8080", {}, false}),
              AccessDecision::kWrongToken)
        << target;
  }
  AccessRules open = kRules;
  open.token = "";
  EXPECT_EQ(check_access(open, {"//index.html", "127.0.0.1:8080", {}, false}),
            AccessDecision::kWrongToken)
      << "an empty token grants nothing";
}

TEST(AccessControl, PathsAreBehindTheToken) {
  EXPECT_EQ(path_in_target(kRules, kTarget), "index.html");
  EXPECT_EQ(path_in_target(kRules, kTarget + "?query"), "index.html");
  EXPECT_EQ(path_in_target(kRules, "/0123456789abcdef0123456789abcdef/"), "");
}

TEST(AccessControl, TokensAreLongAndDiffer) {
  std::set<std::string> tokens;
  for (int i = 0; i < 100; ++i) tokens.insert(make_random_token());
  EXPECT_EQ(tokens.size(), 100U);
  EXPECT_EQ(tokens.begin()->size(), 32U);
}

}  // namespace
}  // namespace raystage::replay
