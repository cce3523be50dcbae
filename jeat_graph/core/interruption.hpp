// What long loops call between their parts, so that a signal ends them soon; what it does says who starts them.
#pragma once

namespace jeat {

// Throws where the work is to end.
using Interruption = void (*)();
inline thread_local Interruption interruption = nullptr;
inline thread_local unsigned parts = 0;

// A part takes some ten microseconds at most but in the worst of cases: not each of them is worth a look at the clock.
inline void may_be_interrupted() {
    if (interruption && (++parts & 31) == 0) interruption();
}

}  // namespace jeat
