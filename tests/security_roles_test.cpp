#include <set>
#include <string>

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include "proto/weft/v1/cluster.pb.h"
#include "proto/weft/v1/render.pb.h"
#include "security/caller.h"

namespace weft::security {
namespace {

TEST(Roles, EveryCallOfEveryServiceNamesOne) {
  int calls = 0;
  for (const google::protobuf::FileDescriptor* file :
       {v1::JobState_descriptor()->file(), v1::PicturePlane_descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        const auto* method = file->service(s)->method(m);
        const std::string call = file->service(s)->name() + "." + method->name();
        EXPECT_NO_THROW(EXPECT_NE(role_needed(call), v1::ROLE_UNSPECIFIED)) << call;
        ++calls;
      }
    }
  }
  EXPECT_GT(calls, 30);
  EXPECT_ANY_THROW((void)role_needed("JobService.Sbumit"));
}

}  // namespace
}  // namespace weft::security
