// One thread at a time in an object that Python's threads share, though its methods release the GIL.
//
// Who waits gives the GIL up, so that whoever is inside can end, and looks for signals now and then. Two things can
// never be waited for, and are errors: a method that is called while the same thread is inside (by a signal's handler),
// and a thread that was inside when the process was forked, which the child does not have.
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <thread>

#ifdef _WIN32
#include <process.h>
#else
#include <unistd.h>
#endif

#include <nanobind/nanobind.h>

namespace jeat {

namespace nb = nanobind;

class Exclusive {
public:
    Exclusive() = default;
    // A copy of an object is one that nobody uses yet.
    Exclusive(const Exclusive&) {}
    Exclusive& operator=(const Exclusive&) { return *this; }

    class Hold {
    public:
        explicit Hold(Exclusive& of) : of_(of) {
            const std::thread::id me = std::this_thread::get_id();
            if (!of.mutex_.try_lock()) {
                const bool of_this_process = of.process_ == process();
                if (of_this_process && of.holder_ == me)
                    throw std::runtime_error("it is in the middle of a call by this very thread");
                wait();
            }
            of.holder_ = me;
            of.process_ = process();
        }
        Hold(const Hold&) = delete;
        Hold& operator=(const Hold&) = delete;
        ~Hold() {
            of_.holder_ = std::thread::id();
            of_.mutex_.unlock();
        }

    private:
        void wait() {
            for (bool inside = false; !inside;) {
                if (of_.process_ != process())
                    throw std::runtime_error("a thread was in the middle of a call when the process was forked");
                {
                    const nb::gil_scoped_release release;
                    inside = of_.mutex_.try_lock_for(std::chrono::milliseconds(50));
                }
                if (!inside && PyErr_CheckSignals() != 0) throw nb::python_error();
            }
        }
        static int process() {
#ifdef _WIN32
            return _getpid();
#else
            return getpid();
#endif
        }

        Exclusive& of_;
    };

private:
    std::timed_mutex mutex_;
    std::atomic<std::thread::id> holder_{};
    std::atomic<int> process_{0};
};

// A method of a class with a member `use`, called by one thread at a time; for nanobind's `def`.
template <class Object, class R, class... A> auto exclusive(R (Object::*method)(A...)) {
    return [method](Object& object, A... arguments) -> R {
        const Exclusive::Hold hold(object.use);
        return (object.*method)(std::forward<A>(arguments)...);
    };
}
template <class Object, class R, class... A> auto exclusive(R (Object::*method)(A...) const) {
    return [method](Object& object, A... arguments) -> R {
        const Exclusive::Hold hold(object.use);
        return (object.*method)(std::forward<A>(arguments)...);
    };
}

}  // namespace jeat
