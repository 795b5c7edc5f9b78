// The encoder for x86-64, by Xbyak: the only file that knows it. No exception leaves it.
#include "linkdyn_emit.h"

#include "linkdyn_code_choice.h"

#include <cstdio>
#include <exception>

#define XBYAK_NO_OP_NAMES
#include <xbyak/xbyak.h>

namespace {

using namespace Xbyak;

// Code of the set may use 32 registers, and masks.
bool has_many_registers(code_set set) {
    return set == CODE_AVX512 || (set == CODE_SCALAR && linkdyn_best_set() == CODE_AVX512);
}

// The most bytes that a step, and the frame of a function, may take.
constexpr size_t step_bytes = 64, function_bytes = 96, literal_bytes = 4096;

enum { less_ordered = 0x11, nearest_even = 8 };    // _CMP_LT_OQ; rounding without the exception for what is lost

}    // namespace

// Registers: rbx slots of the column, r14 constants, r13 columns left.
struct emitter : CodeGenerator {
    const enum code_set set;
    const int width, stride;                       // samples in a register; bytes of a slot
    const int columns;                             // at once
    const bool has_many;
    const lane_functions functions;
    char fault[EMIT_REASON] = "";
    const uint8_t *loop = nullptr;                 // where a column begins
    Label one, magnitude;

    emitter(enum code_set s, int lanes, int n_column, size_t bytes, const lane_functions &f)
        // never writable and executable at once, which is the library's default
        : CodeGenerator(bytes, DontSetProtectRWE), set(s), width(linkdyn_emit_width(s)), stride(8*lanes),
          columns(n_column), has_many(has_many_registers(s)), functions(f) {}

    Xmm reg(int i) const {
        if (set == CODE_AVX512) return Zmm(i);
        if (set == CODE_AVX2) return Ymm(i);
        return Xmm(i);
    }
    Ymm wide(int i) const { return set == CODE_AVX512 ? Zmm(i) : Ymm(i); }
    Xmm scratch() const { return reg(15); }        // of sets without masks
    Address slot(int i) { return ptr[rbx + ((size_t)(i/columns)*stride + (i%columns)*8*width)]; }
    // one number, the same for all lanes
    Address number(const RegExp &at) { return set == CODE_AVX512 ? ptr_b[at] : ptr[at]; }
    Address literal(const Label &l) { return set == CODE_AVX512 ? ptr_b[rip + l] : ptr[rip + l]; }
    Address memory(const place &z) {
        return z.kind == IN_CONSTANT ? number(r14 + (size_t)z.index*8) : slot(z.index);
    }

    void load(const Xmm &d, const place &z) {
        if (z.kind == IN_REGISTER) {
            vmovapd(d, reg(z.index));
        } else if (set == CODE_SCALAR) {
            vmovsd(d, memory(z));
        } else if (z.kind == IN_CONSTANT && set == CODE_AVX512) {
            vbroadcastsd(wide(d.getIdx()), ptr[r14 + (size_t)z.index*8]);
        } else {
            vmovupd(d, memory(z));
        }
    }

// The vector or the scalar form of an instruction with a last operand in a register or in memory.
#define FORM(vector, scalar, ...) do { \
        if (set == CODE_SCALAR) { if (z.kind == IN_REGISTER) scalar(__VA_ARGS__, reg(z.index)); else scalar(__VA_ARGS__, memory(z)); } \
        else { if (z.kind == IN_REGISTER) vector(__VA_ARGS__, reg(z.index)); else vector(__VA_ARGS__, memory(z)); } \
    } while (0)

    void encode(const emit_step &s) {
        const place &z = s.z;
        switch (s.kind) {
        case EMIT_LOAD: load(reg(s.d), z); break;
        case EMIT_STORE:
            if (set == CODE_SCALAR) vmovsd(slot(s.d), reg(s.y));
            else vmovupd(slot(s.d), reg(s.y));
            break;
        case EMIT_ADD: FORM(vaddpd, vaddsd, reg(s.d), reg(s.y)); break;
        case EMIT_SUBTRACT: FORM(vsubpd, vsubsd, reg(s.d), reg(s.y)); break;
        case EMIT_MULTIPLY: FORM(vmulpd, vmulsd, reg(s.d), reg(s.y)); break;
        case EMIT_MINIMUM: FORM(vminpd, vminsd, reg(s.d), reg(s.y)); break;
        case EMIT_MAXIMUM: FORM(vmaxpd, vmaxsd, reg(s.d), reg(s.y)); break;
        case EMIT_RECIPROCAL:
            if (set == CODE_SCALAR) vmovsd(reg(s.d), ptr[rip + one]);
            else vbroadcastsd(wide(s.d), ptr[rip + one]);
            FORM(vdivpd, vdivsd, reg(s.d), reg(s.d));
            break;
        case EMIT_ROOT:
            if (set != CODE_SCALAR) {
                if (z.kind == IN_REGISTER) vsqrtpd(reg(s.d), reg(z.index));
                else vsqrtpd(reg(s.d), memory(z));
            } else if (z.kind == IN_REGISTER) {
                vsqrtsd(reg(s.d), reg(z.index), reg(z.index));
            } else {
                load(reg(s.d), z);
                vsqrtsd(reg(s.d), reg(s.d), reg(s.d));
            }
            break;
        case EMIT_ABSOLUTE: vandpd(reg(s.d), reg(z.index), literal(magnitude)); break;
        case EMIT_WHOLE:
            if (set == CODE_AVX512) vrndscalepd(Zmm(s.d), Zmm(z.index), nearest_even);
            else if (has_many) vrndscalesd(Xmm(s.d), Xmm(z.index), Xmm(z.index), nearest_even);
            else if (set == CODE_SCALAR) vroundsd(reg(s.d), reg(z.index), reg(z.index), nearest_even);
            else vroundpd(Ymm(s.d), Ymm(z.index), nearest_even);
            break;
        case EMIT_SELECT: select(s); break;
#define MULTIPLY_ADD(K, vector, scalar) \
        case EMIT_##K##_132: FORM(vector##132pd, scalar##132sd, reg(s.d), reg(s.y)); break; \
        case EMIT_##K##_213: FORM(vector##213pd, scalar##213sd, reg(s.d), reg(s.y)); break; \
        case EMIT_##K##_231: FORM(vector##231pd, scalar##231sd, reg(s.d), reg(s.y)); break;
        MULTIPLY_ADD(MULTIPLY_ADD, vfmadd, vfmadd)
        MULTIPLY_ADD(MULTIPLY_SUBTRACT, vfmsub, vfmsub)
        MULTIPLY_ADD(SUBTRACT_PRODUCT, vfnmadd, vfnmadd)
#undef MULTIPLY_ADD
        case EMIT_SINE_COSINE: call_on_slots((size_t)functions.sine_cosine, z.index, s.d, s.y); break;
        case EMIT_ARCTANGENT: call_on_slots((size_t)functions.arctangent, s.y, z.index, s.d); break;
        case EMIT_PIECE:
            lea(rdi, slot(z.index));
            lea(rsi, slot(s.d));
            lea(rdx, ptr[r14 + (size_t)s.table*8]);
            mov(ecx, s.which);
            call_function((size_t)functions.piece);
            break;
        case EMIT_PLACE:
            lea(rdi, slot(z.index));
            lea(rsi, slot(s.y));
            lea(rdx, slot(s.d));
            lea(rcx, ptr[r14 + (size_t)s.table*8]);
            mov(r8d, s.which);
            call_function((size_t)functions.place);
            break;
        }
    }
#undef FORM

    void call_on_slots(size_t function, int a, int b, int c) {
        lea(rdi, slot(a));
        lea(rsi, slot(b));
        lea(rdx, slot(c));
        call_function(function);
    }

    void call_function(size_t function) {
        mov(rax, function);
        call(rax);
    }

    // z where 0 < x, else y; all in registers
    void select(const emit_step &s) {
        const Xmm x = reg(s.x), y = reg(s.y), z = reg(s.z.index);
        if (has_many) {
            const Xmm zero(reserved_zero);
            vxorpd(zero, zero, zero);
            if (set == CODE_AVX512) vcmppd(k1, reg(reserved_zero), x, less_ordered);
            else vcmpsd(k1, zero, x, less_ordered);
            vblendmpd(reg(s.d) | k1, y, z);
        } else {
            vxorpd(scratch(), scratch(), scratch());
            if (set == CODE_SCALAR) vcmpsd(scratch(), scratch(), x, less_ordered);
            else vcmppd(scratch(), scratch(), x, less_ordered);
            vblendvpd(reg(s.d), y, z, scratch());
        }
    }
    enum { reserved_zero = 31 };                   // of sets with masks

    size_t begin() {
        align(32);
        const size_t offset = getSize();
        push(rbx);
        push(r13);
        push(r14);                                 // three: the stack is aligned for calls
        mov(rbx, rdi);
        mov(r14, rsi);
        mov(r13, rdx);
        loop = getCurr();
        return offset;
    }

    void end() {
        add(rbx, 8*width*columns);
        dec(r13);
        jnz(loop);
        vzeroupper();
        pop(r14);
        pop(r13);
        pop(rbx);
        ret();
    }

    void put_literals() {
        align(64);
        L(one);
        dq(0x3ff0000000000000);
        align(16);
        L(magnitude);                              // all of a register: and-ing has no form for one number without masks
        for (int i = 0; i < 4; i++) dq(0x7fffffffffffffff);
    }
};

namespace {

// Whatever goes wrong in the library is kept as a fault.
template <class Action> void guarded(emitter *e, Action action) {
    if (e->fault[0]) return;
    try {
        action();
    } catch (const std::exception &error) {
        snprintf(e->fault, sizeof e->fault, "%s", error.what());
    } catch (...) {
        snprintf(e->fault, sizeof e->fault, "the encoder failed");
    }
}

}    // namespace

extern "C" {

int linkdyn_emit_is_there(void) { return 1; }

int linkdyn_emit_width(enum code_set set) { return set == CODE_AVX512 ? 8 : set == CODE_AVX2 ? 4 : 1; }

// One is kept back for comparisons.
int linkdyn_emit_registers(enum code_set set) { return has_many_registers(set) ? 31 : 15; }

struct emitter *linkdyn_emit_open(enum code_set set, int lanes, int columns, size_t n_step, size_t n_function, const lane_functions *functions) {
    try {
        return new emitter(set, lanes, columns, step_bytes*n_step + function_bytes*n_function + literal_bytes, *functions);
    } catch (...) {
        return nullptr;
    }
}

size_t linkdyn_emit_begin(struct emitter *e) {
    size_t offset = 0;
    guarded(e, [&] { offset = e->begin(); });
    return offset;
}

void linkdyn_emit_step(struct emitter *e, const emit_step *step) {
    guarded(e, [=] { e->encode(*step); });
}

void linkdyn_emit_end(struct emitter *e) {
    guarded(e, [=] { e->end(); });
}

const char *linkdyn_emit_close(struct emitter *e, char reason[EMIT_REASON]) {
    const char *code = nullptr;
    guarded(e, [&] {
        e->put_literals();
        if (!e->setProtectModeRE(false)) {
            snprintf(e->fault, sizeof e->fault, "the system lets no new code run");
            return;
        }
        code = reinterpret_cast<const char *>(e->getCode());
    });
    snprintf(reason, EMIT_REASON, "%s", e->fault);
    return e->fault[0] ? nullptr : code;
}

void linkdyn_emit_free(struct emitter *e) { delete e; }

}    // extern "C"
