// Datagrams of Open Sound Control.
#include "core/utf8.h"
#include "session/requests/osc.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto edit = session::edit_of_osc({bytes, size});
  if (!edit) {
    test::check_message(edit.message());
    return 0;
  }
  LIMN_CHECK(is_utf8(edit->action) && is_utf8(edit->slot) && is_utf8(edit->value));
  return 0;
}
